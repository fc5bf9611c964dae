"""As systemd runs it: notifications, watchdog, socket activation, reload, directories, units."""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile

from exhibit import PATIENCE, SOURCE, exhibit, main, wait_for


class Manager:
    """The notification socket of a service manager."""

    def __init__(self, folder):
        self.path = str(folder / "notify")
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.path)
        self.socket.settimeout(PATIENCE)
        self.heard = []

    def hear(self, wanted):
        """Waits for a message that has the line; gives all lines that came until then."""
        while True:
            lines = self.socket.recv(4096).decode().split("\n")
            self.heard += lines
            if any(line.startswith(wanted) for line in lines):
                return self.heard


def tells_ready_status_watchdog_reloading_and_stopping():
    with exhibit() as run:
        manager = Manager(run.folder)
        run.start({"NOTIFY_SOCKET": manager.path, "WATCHDOG_USEC": "200000"})
        heard = manager.hear("READY=1")
        assert "STATUS=showing" not in " ".join(heard)  # the uncompensated picture was up first
        for _ in range(5):
            manager.hear("WATCHDOG=1")
        # Devices took their time with the watchdog's leave, and it was taken back.
        assert manager.heard.index("WATCHDOG_USEC=120000000") < manager.heard.index("WATCHDOG_USEC=200000")
        run.wait_state("showing")
        if not any(line.startswith("STATUS=showing") for line in manager.heard):
            manager.hear("STATUS=showing")
        run.process.send_signal(signal.SIGHUP)
        manager.hear("RELOADING=1")
        manager.hear("READY=1")
        before = len(manager.heard)
        run.process.send_signal(signal.SIGTERM)
        manager.hear("STOPPING=1")
        assert "READY=1" not in manager.heard[before:]
        assert run.process.wait(PATIENCE) == 0


ACTIVATE = """
import os, socket, sys
s = socket.socket(socket.AF_UNIX)
s.bind(sys.argv[1])
s.listen(5)
os.dup2(s.fileno(), 3)
os.set_inheritable(3, True)
os.environ.update(LISTEN_FDS="1", LISTEN_PID=str(os.getpid()))
os.execv(sys.argv[2], sys.argv[2:])
"""


def takes_the_socket_that_systemd_passes():
    with exhibit() as run:
        given = run.folder / "given.sock"
        with open(run.folder / "log", "ab") as log:
            run.process = subprocess.Popen(["/usr/bin/python3", "-c", ACTIVATE, str(given), *run.command()],
                                           stderr=log)
        own, run.socket, run.log = run.socket, given, log
        run.wait_state("showing")
        assert not own.exists()  # nothing else was bound
        code, _ = run.stop()
        assert code == 0
        assert given.exists()  # it is systemd's


def a_bad_file_at_reload_keeps_the_old_configuration():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        good = run.config.read_text()
        run.config.write_text(good.replace("daemon = {", "daemon = { verify_minutes = -1;"))
        run.process.send_signal(signal.SIGHUP)
        wait_for("the complaint", lambda: "the configuration stays as it was" in run.said())
        assert "verify_minutes: is -1; legal is 0 to" in run.said()
        with run.client() as client:
            error = client.refused("reload")
            assert error["code"] == -32000 and "verify_minutes" in error["message"], error
            assert client.ask("status")["state"] == "showing"
            # A good one holds at once; what needs a restart is named.
            copy = run.folder / "copy.png"
            copy.write_bytes(run.content.read_bytes())
            run.config.write_text(good.replace(str(run.content), str(copy)))
            assert client.ask("reload") == {"restart": None, "config": str(run.config)}
            wait_for("the other content", lambda: run.status()["content"] == str(copy))
            run.config.write_text(good.replace('group = ""', 'group = "daemon"'))
            assert client.ask("reload")["restart"] == "group"
            run.write_config(station="rig = { attempts = 5; };")
            assert client.ask("reload")["restart"] == "the devices' sections"
            # A picture that is none is refused by the solver; the last one stays.
            run.write_config(content="/no/such/picture.png")
            client.ask("reload")
            wait_for("the complaint", lambda: "the picture stays" in run.said())
        run.wait_state("showing")


def uses_the_directories_that_systemd_makes():
    with exhibit() as run:
        runtime, state = run.folder / "runtime", run.folder / "kept"
        runtime.mkdir()
        environment = dict(os.environ, RUNTIME_DIRECTORY=str(runtime), STATE_DIRECTORY=f"{state}:/elsewhere")
        with open(run.folder / "log", "ab") as log:
            run.process = subprocess.Popen([run.program, "--config", str(run.config)], env=environment, stderr=log)
        run.socket, run.log = runtime / "control.sock", log
        run.wait_state("showing")
        assert (state / "transport.h5").exists()
        assert run.stop()[0] == 0


def units_for_analysis(folder):
    """The units in a folder; the program is not installed yet: the one that was built stands for it."""
    units = pathlib.Path(os.environ["CLT_UNITS"])
    service = (units / "counterlight.service").read_text()
    start = next(line for line in service.split("\n") if line.startswith("ExecStart="))
    program = start.removeprefix("ExecStart=").split()[0]
    assert program.endswith("/counterlightd") and program.startswith("/"), start
    (pathlib.Path(folder) / "counterlight.service").write_text(service.replace(program, os.path.abspath(sys.argv[1])))
    shutil.copy(units / "counterlight.socket", folder)
    return service


def analyze(*arguments):
    return subprocess.run(["systemd-analyze", *arguments], capture_output=True, text=True)


def the_units_are_valid():
    if shutil.which("systemd-analyze") is None:
        return "skip: systemd-analyze is not installed"
    with tempfile.TemporaryDirectory() as folder:
        service = units_for_analysis(folder)
        done = analyze("verify", "--man=no", "--recursive-errors=one", f"{folder}/counterlight.service",
                       f"{folder}/counterlight.socket")
        assert done.returncode == 0 and not done.stderr.strip(), done.stderr
    for wanted in ("Type=notify", "WatchdogSec=", "Restart=always", "StartLimitIntervalSec=0", "LimitCORE=0"):
        assert wanted in service, wanted
    return None


def the_service_is_hardened():
    """The exposure that systemd counts, out of 10; what is not on is explained in the unit."""
    if shutil.which("systemd-analyze") is None:
        return "skip: systemd-analyze is not installed"
    with tempfile.TemporaryDirectory() as folder:
        service = units_for_analysis(folder)
        unit = f"{folder}/counterlight.service"
        done = analyze("security", "--offline=true", "--no-pager", "--threshold=20", unit)
        if "unrecognized option" in done.stderr:
            return "skip: this systemd-analyze cannot look at units that are not loaded"
        assert done.returncode == 0, done.stdout + done.stderr
        assert analyze("security", "--offline=true", "--no-pager", "--threshold=5", unit).returncode != 0
        open_doors = [line.split()[1].split("=")[0] for line in done.stdout.split("\n") if line.startswith("\u2717")]
    explained = "".join(line for line in service.split("\n") if line.startswith("#"))
    named = set(open_doors) - {"RootDirectory", "DeviceAllow", "UMask"}
    assert named, done.stdout
    for name in named:
        assert f"{name}=" in explained, f"{name} is off and not explained"
    return None


def states_are_printed_as_a_graph():
    with exhibit() as run:
        out = subprocess.run([run.program, "--states"], capture_output=True, text=True, check=True).stdout
    assert out.startswith("digraph") and "opening -> calibrating" in out and "-> holding" in out
    documented = (SOURCE / "docs" / "daemon.md").read_text()
    for state in ("opening", "calibrating", "acquiring", "solving", "showing", "verifying", "holding", "stopping"):
        assert state in out and f"`{state}`" in documented, state


if __name__ == "__main__":
    main([tells_ready_status_watchdog_reloading_and_stopping, takes_the_socket_that_systemd_passes, a_bad_file_at_reload_keeps_the_old_configuration,
          uses_the_directories_that_systemd_makes, the_units_are_valid, the_service_is_hardened, states_are_printed_as_a_graph])
