"""The service under systemd as init, in a guest of its own kernel: see guest_service.py, which runs in there."""
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
RUNNER = pathlib.Path(os.environ.get("CLT_VM_RUN", HERE.parent / "vm" / "run"))


def main():
    kernel = os.environ.get("CLT_VM_KERNEL", "")
    if not RUNNER.exists() or not (pathlib.Path(kernel) / "linux").exists():
        print("skipped: no guest kernel here (CLT_VM_KERNEL)")
        return 77
    # Below /var/tmp: a boot empties /tmp, where this may lie.
    with tempfile.TemporaryDirectory(dir="/var/tmp") as folder:
        root, scripts = f"{folder}/root", f"{folder}/tests/daemon"
        subprocess.run(["meson", "install", "-C", sys.argv[1], "--no-rebuild", "--destdir", root], check=True,
                       capture_output=True)
        shutil.copytree(HERE, scripts)
        job = shlex.join(["/usr/bin/python3", f"{scripts}/guest_service.py", root, *sys.argv[2:]])
        return subprocess.run([RUNNER, "-s", "-t", "500", "-k", kernel, f"{job} 2>&1"], cwd="/").returncode


if __name__ == "__main__":
    sys.exit(main())
