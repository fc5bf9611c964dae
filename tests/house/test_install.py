"""Installs into a fresh folder and uses what is there: headers, library through pkg-config, programs, man pages, units."""
import fnmatch
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

# What is installed beside headers, pictures, scenes and charts; below the prefix, LIB being lib or what Debian makes of it.
INSTALLED = """
bin/counterlight sbin/counterlightd libexec/counterlight-display
LIB/libcounterlight.so LIB/libcounterlight.so.0 LIB/libcounterlight.so.VERSION LIB/pkgconfig/counterlight.pc
LIB/counterlight/libcounterlight-codecs.so
lib/systemd/system/counterlight.service lib/systemd/system/counterlight.socket lib/systemd/system/counterlight-cage.service
lib/sysusers.d/counterlight.conf lib/tmpfiles.d/counterlight.conf lib/udev/rules.d/70-counterlight.rules
share/man/man1/counterlight.1 share/man/man8/counterlightd.8
""".split()

PROGRAM = r"""
#include <counterlight/counterlight.h>
#include <stdio.h>
int main(int count, char **arguments) {
  clt_error error = {0};
  clt_transport *transport = NULL;
  if (clt_transport_create_dense(2, 1, 1, 2, &transport, &error) != CLT_OK) {
    return 1;
  }
  float *entries = clt_transport_entries(transport, 0);
  entries[0] = 1.0f, entries[1] = 0.25f, entries[2] = 0.5f, entries[3] = 1.0f;
  double x[2] = {2, 4}, y[2];
  clt_transport_apply(transport, 0, x, y);
  printf("%g %g\n", y[0], y[1]);
  clt_transport_destroy(transport);
  clt_image picture = {0};
  if (count != 2 || clt_image_read(arguments[1], NULL, &picture, &error) != CLT_OK) {
    puts(error.message);
    return 3;
  }
  clt_image_finish(&picture);
  return clt_curve_parse("no curve", &(clt_curve){0}, &error) == CLT_BAD_INPUT ? 0 : 2;
}
"""


def run(*command, **options):
    return subprocess.run(command, check=True, text=True, capture_output=True, **options).stdout


def installed_files(build, root):
    run("meson", "install", "-C", build, "--no-rebuild", "--destdir", root)
    return sorted(str(p.relative_to(root)) for p in pathlib.Path(root).rglob("*") if not p.is_dir())


def below_the_prefix(build, files):
    """The files' paths below the prefix, with the library folder and the version as INSTALLED has them."""
    options = {o["name"]: o["value"] for o in json.loads(run("meson", "introspect", build, "--buildoptions"))}
    version = json.loads(run("meson", "introspect", build, "--projectinfo"))["version"]
    prefix = options["prefix"].strip("/") + "/"
    assert all(f.startswith(prefix) for f in files), files
    paths = [f.removeprefix(prefix) for f in files]
    library = options["libdir"] + "/"
    of_library = (library + "libcounterlight", library + "counterlight/", library + "pkgconfig/")
    paths = ["LIB/" + f.removeprefix(library) if f.startswith(of_library) else f for f in paths]
    return [f.replace(f".so.{version}", ".so.VERSION") for f in paths]


def nothing_is_missing_or_left_over(paths):
    listed = [f for f in paths if not f.startswith(("include/counterlight/", "share/counterlight/"))]
    wanted = [f for f in INSTALLED if shutil.which("scdoc") or "/man/" not in f]
    assert sorted(listed) == sorted(wanted), set(listed) ^ set(wanted)


def the_packages_take_every_file(paths):
    """Each installed file is in exactly one of the Debian packages."""
    debian = pathlib.Path(sys.argv[0]).resolve().parents[2] / "debian"
    lists = {p.name: [line.split()[0] for line in p.read_text().splitlines() if line] for p in debian.glob("*.install")}
    assert len(lists) == 3, lists
    for path in paths:
        packaged = "usr/" + path.replace("LIB/", "lib/x86_64-linux-gnu/").replace("VERSION", "0.1.0")
        takers = [name for name, patterns in lists.items()
                  if any(fnmatch.fnmatchcase(packaged, p) or fnmatch.fnmatchcase(packaged, p + "/*") for p in patterns)]
        assert len(takers) == 1, (packaged, takers)


def library_serves_a_program(build, root):
    pc = next(pathlib.Path(root).rglob("counterlight.pc"))
    environment = dict(os.environ, PKG_CONFIG_PATH=str(pc.parent), PKG_CONFIG_SYSROOT_DIR=root)
    flags = run("pkg-config", "--cflags", "--libs", "counterlight", env=environment).split()
    source, program = os.path.join(root, "use.c"), os.path.join(root, "use")
    pathlib.Path(source).write_text(PROGRAM)
    sanitize = [o for o in run("meson", "introspect", build, "--buildoptions").split('"') if o == "address,undefined"]
    extra = ["-fsanitize=address,undefined"] if sanitize else []
    run("cc", "-std=c17", "-Wall", "-Wextra", "-Werror", source, "-o", program, *flags, *extra)
    libraries = next(pathlib.Path(root).rglob("libcounterlight.so")).parent
    picture = next(pathlib.Path(root).rglob("moon.png"))
    # The sanitizers' dlopen does not look where this library says that its own lie.
    search = f"{libraries}:{libraries}/counterlight" if sanitize else str(libraries)
    out = run(program, picture, env=dict(os.environ, LD_LIBRARY_PATH=search, ASAN_OPTIONS="detect_leaks=0"))
    assert out == "3 5\n", out
    exported = run("nm", "-D", "--defined-only", str(libraries / "libcounterlight.so")).split("\n")
    foreign = [l for l in exported if l and " T " in l and not l.split()[-1].startswith("clt_")]
    assert not foreign, foreign


def the_daemon_reads_its_content(root):
    """By the codecs that were installed with it."""
    daemon, = pathlib.Path(root).rglob("counterlightd")
    config, = pathlib.Path(root).rglob("simulated.cfg")
    out = run(daemon, "--check", "--config", config, env=dict(os.environ, ASAN_OPTIONS="detect_leaks=0"))
    assert out == f"{config}: OK\n", out


def main():
    build = sys.argv[1]
    for tool in ("meson", "pkg-config", "cc", "nm"):
        if shutil.which(tool) is None:
            print(f"skipped: {tool} is not installed")
            return 77
    with tempfile.TemporaryDirectory() as root:
        files = installed_files(build, root)
        paths = below_the_prefix(build, files)
        nothing_is_missing_or_left_over(paths)
        the_packages_take_every_file(paths)
        for wanted in ("share/counterlight/simulated.cfg", "share/counterlight/scenes/dihedral.cfg"):
            assert wanted in paths, paths
        display = next(pathlib.Path(root).rglob("counterlight-display"))
        assert os.access(display, os.X_OK), display
        headers = {p.name for p in pathlib.Path(sys.argv[0]).parents[2].glob("include/counterlight/*.h")}
        installed = {os.path.basename(f) for f in files if f.endswith(".h")}
        assert headers == installed, headers ^ installed
        library_serves_a_program(build, root)
        the_daemon_reads_its_content(root)
    return 0


if __name__ == "__main__":
    sys.exit(main())
