"""A frame loop that hangs, under a manager that does with the unit what systemd does: how long the last picture is away,
part by part; and what is needed until it is back."""
import os
import pathlib
import shutil
import signal
import socket
import statistics
import time

from exhibit import exhibit, main, wait_for
from test_mishaps import held_up

AWAY_S = 3.0  # that the last picture may be away
HANGS = 3
UNIT = (pathlib.Path(os.environ["CLT_UNITS"]) / "counterlight.service").read_text()
SANITIZED = os.environ["CLT_SANITIZED"] == "yes"


def unit(key):
    """The value of a key of the unit; of times, in seconds."""
    found = [line.partition("=")[2] for line in UNIT.split("\n") if line.startswith(f"{key}=")]
    assert len(found) == 1, (key, found)
    return float(found[0][:-2]) / 1000 if found[0].endswith("ms") else found[0]


class Manager:
    """Starts the daemon, hears what it tells, ends it where it does not feed the watchdog, and starts it again. Times are
    of the monotonic clock."""

    def __init__(self, run, **environment):
        self.run, self.environment = run, environment
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(run.folder / "notify"))
        self.start()

    def start(self):
        """Also waits for the first picture; gives the processor's time that the start took until then."""
        self.allowed = unit("WatchdogSec")
        self.run.start({"NOTIFY_SOCKET": str(self.run.folder / "notify"), "WATCHDOG_USEC": str(int(self.allowed * 1e6)),
                        "OMP_WAIT_POLICY": "passive", **self.environment})
        began = self.fed = time.monotonic()
        self.hear(60, lambda lines: "READY=1" in lines)
        self.took, self.used = time.monotonic() - began, self.processor_time()
        return self

    def processor_time(self):
        fields = (self.run.process_folder() / "stat").read_text().rsplit(") ")[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def hear(self, seconds, until):
        """Takes what is told, until it satisfies; False after the seconds."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                lines = self.socket.recv(4096).decode().split("\n")
            except TimeoutError:
                return False
            told = [line for line in lines if line.startswith("WATCHDOG_USEC=")]
            self.allowed = int(told[-1].partition("=")[2]) / 1e6 if told else self.allowed
            self.fed = time.monotonic() if told or "WATCHDOG=1" in lines else self.fed
            if until(lines):
                return True
        return False

    def wait_state(self, wanted):
        """Hears meanwhile: the daemon waits for a manager that does not."""
        def there():
            self.hear(0.01, lambda lines: False)
            status = self.run.status()
            return status if status["state"] == wanted else None
        return wait_for(wanted, there)

    def watch(self):
        """Returns when the watchdog has not been fed for as long as the daemon may take."""
        while (left := self.fed + self.allowed - time.monotonic()) > 0:
            self.hear(left, lambda lines: True)

    def again(self):
        """Ends it, waits and starts it as the unit says; gives the seconds that dying took."""
        began = time.monotonic()
        self.run.stop(getattr(signal, unit("WatchdogSignal")))
        took = time.monotonic() - began
        time.sleep(unit("RestartSec"))
        self.start()
        return took


def the_last_picture_is_back_within_three_seconds():
    """What waits is the unit's and does not depend on the machine; what works is told in the processor's time, which a
    machine with other things to do does not add to."""
    with exhibit() as run:
        manager, worked, away = Manager(run), [], []
        manager.wait_state("showing")
        for _ in range(HANGS):
            assert manager.hear(60, lambda lines: "WATCHDOG=1" in lines)
            before = run.process.pid
            with held_up(before) as stopped:
                if not stopped:
                    return "skip: no thread can be stopped here"
                hung = time.monotonic()
                manager.watch()
                noticed = time.monotonic() - hung
                died = manager.again()
            away.append(time.monotonic() - hung)
            worked.append(manager.used)
            first = run.status()["frame"]
            assert first["recalled"] or first["compensated"], first
            print(f"noticed after {noticed:.2f} s, dead after {died:.3f}, picture {manager.took:.2f} after the start of which "
                  f"{manager.used:.2f} of a processor's time: away for {away[-1]:.2f} s")
            assert run.process.pid != before
            manager.wait_state("showing")
        waited = unit("WatchdogSec") + unit("RestartSec")
        least = statistics.median(worked)
        print(f"waits {waited:.2f} s, works {least:.2f} s")
        assert min(away) >= unit("RestartSec")
        assert SANITIZED or waited + least < AWAY_S - 0.5, (waited, least)
        assert run.stop()[0] == 0
        return None


def write_as_before(path, data):
    """Replaces what is in a file, whose time and size stay."""
    about = path.stat()
    path.write_bytes(data)
    os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))


def the_last_picture_needs_nothing_that_takes_time():
    """No content, no transport, no codec: it is up without them, and stays where they are missing."""
    with exhibit() as run:
        content, transport = run.folder / "picture.png", run.state / "transport.h5"
        shutil.copy(run.content, content)
        run.write_config(content=content)
        manager = Manager(run, LD_LIBRARY_PATH="")  # meson names the build folder in it
        manager.wait_state("showing")
        run.stop(signal.SIGKILL)
        picture, stored = content.read_bytes(), transport.read_bytes()
        write_as_before(content, bytes(len(picture)))
        transport.unlink()
        os.mkfifo(transport)  # who opens it waits
        manager.start()
        first = run.status()
        assert first["frame"]["recalled"] and not first["frame"]["compensated"] and first["frame"]["presented"] > 0, first
        assert first["state"] == "calibrating" and first["transport"] is None, first
        run.stop(signal.SIGKILL)
        transport.unlink()
        transport.write_bytes(stored)
        write_as_before(content, picture)
        run.program = shutil.copy(run.program, run.folder / "counterlightd")  # away from libcounterlight-codecs.so
        manager.start()
        held = manager.wait_state("holding")
        assert held["frame"]["recalled"] and "libcounterlight-codecs.so" in held["why"], held
        # A file that changed is no content that the stored drive is for.
        run.stop()
        content.write_bytes(bytes(len(picture)))
        code, said = run.run()
        assert code == 2 and "picture.png" in said, (code, said)


if __name__ == "__main__":
    main([the_last_picture_is_back_within_three_seconds, the_last_picture_needs_nothing_that_takes_time])
