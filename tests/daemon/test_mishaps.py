"""Killed at any moment, a disk that is full, a file system that takes nothing, a frame loop that hangs."""
import collections
import contextlib
import ctypes
import os
import random
import re
import signal
import socket
import subprocess
import time

import h5py
import numpy

from exhibit import exhibit, main, wait_for

KILLS, PHASES = int(os.environ.get("CLT_KILLS", "50")), ("acquiring", "solving", "saving")
STATES = ("opening", "calibrating", "acquiring", "solving", "showing", "verifying", "holding", "stopping")
NOISE = 0.02  # by which two measured transports differ
PTRACE_SEIZE, PTRACE_INTERRUPT, PTRACE_DETACH = 0x4206, 0x4207, 17


def stored_transport(run):
    """The transport that is stored, which is whole."""
    with h5py.File(run.state / "transport.h5") as file:
        assert file.attrs["format"] in ("counterlight-transport", b"counterlight-transport")
        dense = file["dense"][:]
    assert numpy.isfinite(dense).all() and (numpy.einsum("cii->ci", dense) > 0).all()
    return dense


def phase(run, said):
    """What the daemon is at: a state, as the log tells it after what was `said` before, or saving where it is writing what
    it solved with."""
    told = re.findall(rf"^({'|'.join(STATES)})\b", run.said()[said:], re.M)
    state = told[-1] if told else ""
    saves = state == "solving" and any(name.startswith(f".new-{run.process.pid}-") for name in os.listdir(run.state))
    return "saving" if saves else state


def pass_phases(run):
    """Lets it come to showing; gives the seconds that were spent in each phase."""
    spent, before = collections.Counter(), time.monotonic()

    def showing():
        nonlocal before
        at, now = phase(run, 0), time.monotonic()
        spent[at], before = spent[at] + now - before, now
        return at == "showing"
    wait_for("showing", showing, pause=0.0005)
    return spent


def killed_at_any_moment_it_comes_back():
    """In each phase in turn, after a part of it that is random. Every start measures, one in three from the beginning,
    and must come as far again with what the killed one left, which is a transport as good as the first to the last
    number of it."""
    with exhibit() as run:
        run.write_config(daemon='retry_s = [0.05, 0.4]; at_start = "acquire";')
        dice, met, off = random.Random(7), [], []
        run.start()
        spent, first = pass_phases(run), stored_transport(run)
        for kill in range(KILLS):
            run.stop(signal.SIGKILL)
            off.append(numpy.linalg.norm(stored_transport(run) - first) / numpy.linalg.norm(first))
            wanted, said = PHASES[kill % len(PHASES)], len(run.said())
            if wanted == "acquiring":  # all of it; the two starts after that go on with what is there
                (run.state / "acquisition.journal").unlink(missing_ok=True)
            run.start()
            wait_for(wanted, lambda: phase(run, said) in (wanted, "showing"), pause=0.0005)
            time.sleep(dice.uniform(0, spent[wanted]))
            met.append(phase(run, said))
        run.stop(signal.SIGKILL)
        stored_transport(run)
        run.write_config()
        run.start()
        assert run.wait_state("showing")["frame"]["compensated"]
        assert "cannot be used" not in run.said()
        assert not list(run.state.glob(".new-*")) and not list(run.state.glob("*.bad-*"))
        counts = collections.Counter(met)
        print("killed while", dict(counts), f"transports differ by {max(off):.2%} at most")
        assert max(off) < NOISE, off
        assert all(counts[at] >= KILLS // 10 for at in PHASES), counts


def on_a_file_system_of_its_own(run, size, then):
    """Starts the daemon with a tmpfs of that size as state directory, of which the shell command `then` has the say
    first. False where this may not be done here."""
    probe = subprocess.run(["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True)
    if probe.returncode != 0:
        return False
    run.state.mkdir()
    mount = f'mount -t tmpfs -o size={size} none "$0" && {then} && exec "$@"'
    command = ["unshare", "-rm", "sh", "-c", mount, str(run.state), *run.command()]
    run.log = open(run.folder / "log", "ab")
    run.process = subprocess.Popen(command, stderr=run.log)
    return True


def inside(run, name):
    """The path, seen from here, of a file in the daemon's own file system."""
    return f"/proc/{run.process.pid}/root{run.state}/{name}"


def a_full_disk_is_survived_and_used_when_there_is_room():
    with exhibit() as run:
        if not on_a_file_system_of_its_own(run, "2m", 'dd if=/dev/zero of="$0/filler" bs=4k status=none 2>/dev/null || :'):
            return "skip: no file system can be mounted here"
        status = run.wait_state("showing")
        assert status["frame"]["compensated"], status
        assert "the new transport is in use and will not survive a restart" in run.said()
        assert not os.path.exists(inside(run, "transport.h5"))
        with run.client() as client, open(run.content, "rb") as file:
            told = client.refused("show", descriptor=file.fileno(), path="moon")
            assert "No space left" in told["message"], told
            client.ask("subscribe")
            os.unlink(inside(run, "filler"))
            client.ask("reacquire")
            client.until("showing")
            with h5py.File(inside(run, "transport.h5")) as stored:
                assert numpy.isfinite(stored["dense"][:]).all()
            assert client.ask("show", descriptor=os.open(run.content, os.O_RDONLY), path="moon")["content"] == "moon"
        assert not any(name.startswith(".new-") for name in os.listdir(inside(run, "")))
        assert run.stop()[0] == 0
        return None


def a_file_system_that_takes_nothing_is_a_warning():
    with exhibit() as run:
        if not on_a_file_system_of_its_own(run, "2m", 'mount -o remount,ro "$0"'):
            return "skip: no file system can be mounted here"
        assert run.wait_state("showing")["frame"]["compensated"]
        assert "nothing will survive a restart" in run.said() and "Read-only file system" in run.said()
        with run.client() as client, open(run.content, "rb") as file:
            assert client.ask("show", descriptor=file.fileno(), path="moon")["content"] == "moon"
        assert run.stop()[0] == 0
        return None


@contextlib.contextmanager
def held_up(thread):
    """Stops one thread, as a driver that never returns would; gives false where that may not be done here."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
    stopped = libc.ptrace(PTRACE_SEIZE, thread, None, None) == 0
    if stopped:
        assert libc.ptrace(PTRACE_INTERRUPT, thread, None, None) == 0
        os.waitpid(thread, 0x40000000)  # __WALL
    try:
        yield stopped
    finally:
        if stopped:
            libc.ptrace(PTRACE_DETACH, thread, None, None)


def the_watchdog_is_fed_by_the_frame_loop_alone():
    """While the main thread hangs, clients are still answered and systemd hears nothing."""
    with exhibit() as run:
        manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        manager.bind(str(run.folder / "notify"))
        manager.setblocking(False)
        run.start({"NOTIFY_SOCKET": str(run.folder / "notify"), "WATCHDOG_USEC": "1500000"})

        def heard():
            """All that came since it was last asked."""
            with contextlib.suppress(BlockingIOError):
                return [manager.recv(4096), *heard()]
            return []

        def hears():
            return b"WATCHDOG=1" in heard()
        wait_for("showing", lambda: (heard(), run.status())[1]["state"] == "showing")
        wait_for("a feeding", hears)
        with held_up(run.process.pid) as stopped:
            if not stopped:
                return "skip: no thread can be stopped here"
            time.sleep(1)  # the last report may be on its way
            heard()
            time.sleep(1)
            assert not hears()
            assert run.status()["state"] == "showing"
        wait_for("the next feeding", hears)
        assert run.stop()[0] == 0
        return None


if __name__ == "__main__":
    main([killed_at_any_moment_it_comes_back, a_full_disk_is_survived_and_used_when_there_is_room,
          a_file_system_that_takes_nothing_is_a_warning, the_watchdog_is_fed_by_the_frame_loop_alone])
