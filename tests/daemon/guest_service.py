"""Runs in a guest whose init is systemd, as root: installs what DESTDIR holds, starts the service as a boot does, and
ill-treats it. Arguments: DESTDIR, and names of tests (none: all)."""
import collections
import contextlib
import fcntl
import grp
import json
import os
import pathlib
import pwd
import random
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy

from exhibit import Client, main, wait_for

HERE = pathlib.Path(__file__).resolve().parent
SOCKET, STATE = pathlib.Path("/run/counterlight/control.sock"), pathlib.Path("/var/lib/counterlight")
UNIT = "counterlight.service"
KILLS, BACK_S = 5, 3.0
NOISE = 0.02  # by which two measured transports differ
NOBODY = pwd.getpwnam("nobody").pw_uid


def run(*command, check=True, **options):
    done = subprocess.run(command, text=True, capture_output=True, **options)
    assert not check or done.returncode == 0, (command, done.stdout, done.stderr)
    return done.stdout.strip()


def property_of(name, unit=UNIT):
    return run("systemctl", "show", "--value", "-p", name, unit)


def process():
    """The daemon's process, 0 where there is none."""
    try:
        return min(map(int, pathlib.Path("/sys/fs/cgroup/system.slice", UNIT, "cgroup.procs").read_text().split()), default=0)
    except OSError:
        return 0


def journal(*matches):
    return run("journalctl", "-q", "--no-pager", "-u", UNIT, *matches)


def cursor():
    """The place in the journal from which on journal() is to look."""
    run("journalctl", "--sync")
    return "--after-cursor=" + json.loads(run("journalctl", "-q", "-n", "1", "-o", "json"))["__CURSOR"]


def status():
    with Client(SOCKET) as client:
        return client.ask("status")


def shown():
    """The status where a compensated picture is on the glass, else None."""
    with contextlib.suppress(OSError, AssertionError, ValueError):
        found = status()
        return found if found["frame"]["compensated"] and found["frame"]["presented"] > 0 else None
    return None


def recalled():
    """The status where the last run's picture is on the glass, or a newer one."""
    with contextlib.suppress(OSError, AssertionError, ValueError):
        frame = status()["frame"]
        return frame if (frame["recalled"] or frame["compensated"]) and frame["presented"] > 0 else None
    return None


def wait_showing():
    def showing():
        found = shown()
        return found if found and found["state"] == "showing" else None
    try:
        return wait_for("showing", showing)
    except AssertionError as late:
        raise AssertionError(f"{late}; the journal ends so:\n{journal('-n', '20')}") from late


def configure(**changes):
    """The simulated configuration as it is installed, with values of keys replaced."""
    text = (SHARE / "simulated.cfg").read_text()
    text = text.replace('"scenes/', f'"{SHARE}/scenes/').replace('"pictures/', f'"{SHARE}/pictures/')
    for key, value in changes.items():
        lines = text.split("\n")
        text = "\n".join(f"  {key} = {value};" if line.strip().startswith(f"{key} =") else line for line in lines)
    CONFIG.write_text(text)


def drop_in(unit, text):
    folder = pathlib.Path("/run/systemd/system") / f"{unit}.d"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "test.conf").write_text(text)
    run("systemctl", "daemon-reload")


def install():
    """As `ninja install` and a first boot: users, folders, rules, units; nobody logs in and there is no network."""
    run("cp", "-a", f"{sys.argv[1]}/.", "/")
    run("systemd-sysusers", "counterlight.conf")
    assert pwd.getpwnam("counterlight").pw_dir == str(STATE)
    run("systemd-tmpfiles", "--create", "counterlight.conf")
    CONFIG.parent.mkdir(parents=True, exist_ok=True)
    CONFIG.symlink_to(SHARE / "simulated.cfg")
    run("udevadm", "control", "--reload")
    run("systemctl", "daemon-reload")
    run("systemctl", "enable", UNIT)
    # What the boot does once it knows of the unit: the targets pull in all that is enabled.
    run("systemctl", "start", "--no-block", "sockets.target", "multi-user.target")


def boots_to_showing_unattended():
    install()
    found = wait_showing()
    CONFIG.unlink()
    configure()
    assert found["devices"]["projector"] == "simulated" and found["frame"]["late"] >= 0, found
    assert property_of("ActiveState") == "active" and property_of("NRestarts") == "0"
    wait_for("the status text", lambda: property_of("StatusText").startswith("showing "))
    owner = pathlib.Path(f"/proc/{process()}").stat()
    assert pwd.getpwuid(owner.st_uid).pw_name == "counterlight"
    lines = pathlib.Path(f"/proc/{process()}/status").read_text().split("\n")
    held = dict(line.split(":\t") for line in lines if ":\t" in line)
    assert int(held["CapEff"], 16) == 0 and held["NoNewPrivs"] == "1" and held["Seccomp"] == "2", held
    assert "70-counterlight.rules" not in run("journalctl", "-q", "--no-pager", "-u", "systemd-udevd")


def the_journal_has_fields():
    found = [json.loads(line) for line in journal("-o", "json", "COUNTERLIGHT_STATE=showing").split("\n")]
    assert found and found[-1]["PRIORITY"] == "6" and found[-1]["MESSAGE"].startswith("showing "), found
    assert found[-1]["COUNTERLIGHT_CONTENT"].endswith("moon.png")
    assert found[-1]["COUNTERLIGHT_PROJECTOR"] == found[-1]["COUNTERLIGHT_CAMERA"] == "simulated"
    with Client(SOCKET) as client:
        client.ask("hold")
        client.ask("resume")
    wait_showing()
    asked = json.loads(journal("-o", "json", "COUNTERLIGHT_METHOD=hold").split("\n")[-1])
    assert asked["COUNTERLIGHT_CLIENT_UID"] == "0" and asked["COUNTERLIGHT_CLIENT_PID"] == str(os.getpid()), asked
    assert "asked to hold" in journal("COUNTERLIGHT_STATE=holding")


def the_socket_starts_the_service_and_is_for_its_group():
    made = SOCKET.stat()
    assert made.st_mode & 0o777 == 0o660 and grp.getgrgid(made.st_gid).gr_name == "counterlight"
    run("systemctl", "stop", UNIT)
    assert property_of("ActiveState") == "inactive" and SOCKET.exists()
    assert status()["state"]  # asked of nobody: systemd starts it, and it answers
    assert property_of("ActiveState") in ("active", "activating")
    wait_showing()

    def ask(*groups):
        done = subprocess.run(["/usr/bin/python3", "-", str(SOCKET), '[["reacquire", ""]]'], user=NOBODY, group=NOBODY, cwd="/",
                              extra_groups=groups, input=(HERE / "member.py").read_bytes(), capture_output=True)
        return json.loads(done.stdout)
    assert ask()["error"] == "Permission denied"
    assert ask(made.st_gid)["result"]["state"] == "acquiring"
    wait_showing()


def another(before):
    """Another process than before, else None; takes note of the death of one whose thread was held up from here."""
    with contextlib.suppress(ChildProcessError):
        os.waitpid(before, os.WNOHANG | 0x40000000)  # __WALL
    now = process()
    return now if now not in (0, before) else None


def hang(stop):
    """Stops the daemon in some way; gives the time until its picture is up again, by another process."""
    wait_showing()
    before, drive = process(), (STATE / "drive.npy").read_bytes()
    with stop(before) as done:
        assert done
        began = time.monotonic()
        wait_for("another process", lambda: another(before))
        wait_for("its picture", recalled)
        passed = time.monotonic() - began
        assert (STATE / "drive.npy").read_bytes() == drive
        wait_for("its picture, computed again", shown)
        computed = time.monotonic() - began
    assert (STATE / "drive.npy").read_bytes() == drive
    return passed, computed


@contextlib.contextmanager
def stopped(_):
    run("systemctl", "kill", "--signal=SIGSTOP", UNIT)
    yield True


def a_hung_frame_loop_is_back_within_three_seconds():
    """All threads stopped, and the main thread alone, as by a driver that never returns. In virtual time, where programs
    take none: these are the seconds that are waited."""
    from test_mishaps import held_up
    for stop in (stopped, held_up):
        since, (passed, computed) = cursor(), hang(stop)
        print(f"{stop.__name__}: back after {passed:.2f} s, computed again after {computed:.2f} s")
        assert passed <= computed <= BACK_S, (passed, computed)
        assert "Watchdog timeout" in journal(since)


def stored_transport():
    with h5py.File(STATE / "transport.h5") as file:
        return file["dense"][:]


def killed_while_it_measures_it_comes_back():
    """test_mishaps.py has all moments. Here programs take no time: moments are told apart by the answers that the daemon
    gives meanwhile."""
    wait_showing()
    dice, met, first = random.Random(11), [], stored_transport()
    for _ in range(KILLS):
        before = process()
        with Client(SOCKET) as client:
            client.ask("reacquire")
            met.append([client.ask("status")["state"] for _ in range(dice.randrange(1, 5))][-1])
        os.kill(before, signal.SIGKILL)
        wait_for("another process", lambda: another(before))
        wait_for("what it was at to be ended", lambda: not (STATE / "acquisition.journal").exists())
        wait_showing()
        assert numpy.linalg.norm(stored_transport() - first) < NOISE * numpy.linalg.norm(first)
    print("killed while", collections.Counter(met))
    assert met.count("acquiring") > KILLS // 2, met
    assert "cannot be used" not in journal() and not list(STATE.glob("*.bad-*"))


def a_state_directory_that_is_full_or_read_only_is_survived():
    run("systemctl", "stop", UNIT)
    owner = pwd.getpwnam("counterlight")
    run("mount", "-t", "tmpfs", "-o", f"size=256k,mode=0750,uid={owner.pw_uid},gid={owner.pw_gid}", "none", str(STATE))
    with contextlib.suppress(OSError), open(STATE / "filler", "wb") as file:
        file.write(bytes(1 << 20))
    try:
        for options, complaints in (("rw", ("will not survive a restart", "No space left")),
                                    ("ro", ("nothing will survive a restart",))):
            run("systemctl", "stop", UNIT)
            run("mount", "-o", f"remount,{options}", str(STATE))
            since = cursor()
            run("systemctl", "start", UNIT)
            wait_showing()
            for complaint in complaints:
                assert complaint in journal(since), complaint
    finally:
        run("systemctl", "stop", UNIT)
        run("umount", str(STATE))
        run("systemctl", "start", UNIT)


def a_clock_that_jumps_changes_nothing():
    wait_showing()
    before, restarts = process(), property_of("NRestarts")
    for jump in ("+400 days", "-800 days", "+400 days"):
        run("date", "-s", jump)
        frames = status()["frame"]["presented"]
        wait_for("more frames", lambda: status()["frame"]["presented"] > frames + 20)
        assert status()["state"] == "showing"
    with Client(SOCKET) as client:
        assert client.ask("snapshot")["observation"]
        client.ask("reacquire")
    wait_showing()
    assert process() == before and property_of("NRestarts") == restarts


def a_bad_file_at_reload_keeps_the_old_configuration():
    wait_showing()
    before, since = process(), cursor()
    configure(verify_minutes="-1")
    run("systemctl", "reload", UNIT)
    wait_for("the complaint", lambda: "the configuration stays as it was" in journal(since))
    assert "verify_minutes: is -1; legal is" in journal(since)
    assert status()["state"] == "showing" and process() == before
    configure()
    run("systemctl", "reload", UNIT)
    wait_for("the better file", lambda: "read again" in journal(since))


def open_in_the_sandbox(*cases):
    """For each (path, user): whether a program with all of the service's restrictions, as that user, can open the path
    for reading and writing. The units stay, as sandbox-0.service, ..."""
    unit = next(pathlib.Path("/", prefix).rglob(UNIT)).read_text()
    left_out = ("Type=", "ExecStart=", "ExecReload=", "User=", "Group=", "WatchdogSec=", "Restart", "PartOf=", "Requires=",
                "StateDirectory", "EnvironmentFile=", "Condition")
    kept = "\n".join(line for line in unit.split("[Install]")[0].split("\n") if not line.startswith(left_out))
    names = [f"sandbox-{number}.service" for number in range(len(cases))]
    for name, (path, user) in zip(names, cases):
        pathlib.Path("/run/systemd/system", name).write_text(f"""{kept}
Type=oneshot
User={user}
ExecStart=/usr/bin/python3 -c 'import os; os.close(os.open("{path}", os.O_RDWR | os.O_NONBLOCK))'
""")
    run("systemctl", "daemon-reload")
    run("systemctl", "start", *names, check=False)
    return [property_of("Result", name) == "success" for name in names]


def the_sandbox_lets_cameras_through_and_nothing_else():
    nodes = pathlib.Path("/dev").glob
    if run("modprobe", "vivid", "n_devs=1", "node_types=1", check=False) or not wait_for("a camera", lambda: [*nodes("video*")]):
        return "skip: no simulated camera in this kernel"
    run("udevadm", "settle")
    camera = sorted(nodes("video*"))[0]
    assert camera.group() == "video" and "systemd" in run("udevadm", "info", "-q", "property", "-n", str(camera))
    media = sorted(nodes("media*"))[:1]
    assert pathlib.Path("/dev/uinput").exists() and os.open("/dev/uinput", os.O_RDWR)
    keyboard, *cameras = open_in_the_sandbox(("/dev/uinput", "root"), *((path, "counterlight") for path in (camera, *media)))
    assert all(cameras), cameras
    if "does not support BPF" in run("journalctl", "-q", "--no-pager"):
        return "skip: this kernel cannot keep devices from services; that cameras pass is checked"
    assert not keyboard
    assert "Operation not permitted" in run("journalctl", "-q", "-n", "20", "--no-pager", "-u", "sandbox-0.service")
    return None


def the_sandbox_lets_threads_go_behind_each_other():
    """What is on the glass before other programs, what is computed for later behind them (src/daemon/rank.h)."""
    wait_showing()
    ranks = [int(task.joinpath("stat").read_text().rpartition(")")[2].split()[16])
             for task in pathlib.Path(f"/proc/{process()}/task").iterdir()]
    assert min(ranks) == -10 and max(ranks) == 15, ranks


def the_daemon_goes_up_and_down_with_its_display():
    if shutil.which("cage") is None or shutil.which("seatd") is None:
        return "skip: cage or seatd is not installed"
    cage = "counterlight-cage.service"
    drop_in(cage, "[Unit]\nRequires=\n[Service]\nEnvironment=WLR_BACKENDS=headless WLR_RENDERER=pixman\n")
    run("systemctl", "enable", cage)
    run("systemctl", "restart", UNIT)
    wait_showing()
    first = process()

    def display():
        words = pathlib.Path(f"/proc/{process()}/environ").read_bytes().split(b"\0")
        return dict(word.split(b"=", 1) for word in words if b"=" in word).get(b"WAYLAND_DISPLAY", b"").decode()
    place = pathlib.Path("/run/counterlight-display") / display()
    assert place.is_socket() and pwd.getpwuid(place.stat().st_uid).pw_name == "counterlight", place
    os.kill(int(property_of("MainPID", cage)), signal.SIGKILL)
    wait_for("another daemon", lambda: another(first))
    wait_showing()
    assert (pathlib.Path("/run/counterlight-display") / display()).is_socket()
    run("systemctl", "disable", "--now", cage)
    wait_for("the daemon's end", lambda: property_of("ActiveState") == "inactive")
    return None


prefix = next(p for p in pathlib.Path(sys.argv[1]).rglob("simulated.cfg")).parents[2].relative_to(sys.argv[1])
SHARE = pathlib.Path("/") / prefix / "share" / "counterlight"
CONFIG = pathlib.Path(run("sed", "-n", "s/^ConditionPathExists=//p",
                          str(next(pathlib.Path(sys.argv[1]).rglob("counterlight.service")))))

def has_file_locks():
    """Without them systemd makes no users and the daemon takes no state directory."""
    try:
        with open("/run/lock-test", "w") as file:
            fcntl.lockf(file, fcntl.LOCK_EX)
        return True
    except OSError:
        return False


if __name__ == "__main__":
    if not has_file_locks():
        print("skipped: the guest's kernel has no file locks (CONFIG_FILE_LOCKING)")
        sys.exit(77)
    main([boots_to_showing_unattended, the_journal_has_fields, the_socket_starts_the_service_and_is_for_its_group,
          a_hung_frame_loop_is_back_within_three_seconds, killed_while_it_measures_it_comes_back,
          a_state_directory_that_is_full_or_read_only_is_survived, a_clock_that_jumps_changes_nothing,
          a_bad_file_at_reload_keeps_the_old_configuration, the_sandbox_lets_cameras_through_and_nothing_else,
          the_sandbox_lets_threads_go_behind_each_other, the_daemon_goes_up_and_down_with_its_display])
