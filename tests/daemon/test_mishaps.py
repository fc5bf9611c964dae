"""Killed at any moment, a disk that is full, a file system that takes nothing, a frame loop that hangs."""
import contextlib
import ctypes
import os
import random
import signal
import socket
import subprocess
import time

import h5py
import numpy

from exhibit import exhibit, main, wait_for

KILLS = int(os.environ.get("CLT_KILLS", "12"))
PTRACE_SEIZE, PTRACE_INTERRUPT, PTRACE_DETACH = 0x4206, 0x4207, 17


def check_transport(run, width, height, channels):
    """The transport that is stored is whole."""
    with h5py.File(run.state / "transport.h5") as file:
        assert file.attrs["format"] in ("counterlight-transport", b"counterlight-transport")
        dense = file["dense"][:]
        assert dense.shape == (channels, width * height, width * height) and numpy.isfinite(dense).all()
        assert (numpy.einsum("cii->ci", dense) > 0).all()


def wait_until(check, end):
    """Polls as fast as may be, so that the moment is not missed, up to a time."""
    while not check() and time.monotonic() < end:
        time.sleep(0.0003)


def is_saving(run):
    """A file is being written in the state directory."""
    return run.state.exists() and any(name.startswith(".new-") for name in os.listdir(run.state))


def last_word(run):
    """The state that the log tells last."""
    return run.said().rstrip().rsplit("\n", 1)[-1].split(" ")[0].rstrip(":")


def wait_for_a_moment(run, dice, kind, whole, acquiring):
    """One that is random in the whole start, or while acquiring, or while something is saved."""
    end = time.monotonic() + 2 * whole
    if kind == 0:
        time.sleep(dice.uniform(0, 1.2 * whole))
    elif kind == 1:
        wait_until(lambda: last_word(run) == "acquiring", end)
        time.sleep(dice.uniform(0, acquiring))
    else:
        wait_until(lambda: is_saving(run), end)


def killed_at_any_moment_it_comes_back():
    """Every start measures anew, and must find what the killed one left whole."""
    width, height, channels = 16, 12, 3
    with exhibit(width, height, channels) as run:
        run.write_config(daemon='retry_s = [0.05, 0.4]; at_start = "acquire";')
        dice, moments, saving = random.Random(7), [], 0
        began = time.monotonic()
        run.start()
        wait_until(lambda: last_word(run) == "acquiring", began + 60)
        opened = time.monotonic()
        run.wait_state("showing")
        whole, acquiring = time.monotonic() - began, time.monotonic() - opened
        for kill in range(KILLS):
            run.stop(signal.SIGKILL)
            check_transport(run, width, height, channels)
            run.start()
            wait_for_a_moment(run, dice, kill % 3, whole, acquiring)
            moments.append(last_word(run))
            saving += is_saving(run)
        run.stop(signal.SIGKILL)
        check_transport(run, width, height, channels)
        run.write_config()
        run.start()
        assert run.wait_state("showing")["frame"]["compensated"]
        assert "cannot be used" not in run.said()
        assert not list(run.state.glob(".new-*")) and not list(run.state.glob("*.bad-*"))
        print("killed while", {moment: moments.count(moment) for moment in sorted(set(moments))}, "saving:", saving)
        assert "acquiring" in moments and saving > 0, moments


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
        manager.settimeout(1)
        run.start({"NOTIFY_SOCKET": str(run.folder / "notify"), "WATCHDOG_USEC": "1500000"})
        run.wait_state("showing")

        def hears():
            with contextlib.suppress(TimeoutError):
                while True:
                    if manager.recv(4096) == b"WATCHDOG=1":
                        return True
            return False
        assert hears()
        with held_up(run.process.pid) as stopped:
            if not stopped:
                return "skip: no thread can be stopped here"
            manager.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                while True:
                    manager.recv(4096)
            time.sleep(1)  # the last report may be on its way
            with contextlib.suppress(BlockingIOError):
                while True:
                    manager.recv(4096)
            manager.settimeout(1)
            assert not hears()
            assert run.status()["state"] == "showing"
        wait_for("the next feeding", hears)
        assert run.stop()[0] == 0
        return None


if __name__ == "__main__":
    main([killed_at_any_moment_it_comes_back, a_full_disk_is_survived_and_used_when_there_is_room,
          a_file_system_that_takes_nothing_is_a_warning, the_watchdog_is_fed_by_the_frame_loop_alone])
