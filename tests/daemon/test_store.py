"""What is in the state directory at the start: whole, damaged, of another room, or not writable."""
import contextlib
import os
import pathlib
import shutil
import signal
import subprocess

import h5py
import numpy

from exhibit import exhibit, main, wait_for


def made(run):
    """Runs once, so that there is something stored; gives the transport's bytes."""
    run.start()
    run.wait_state("showing")
    run.stop()
    return (run.state / "transport.h5").read_bytes()


def damaged_transports_are_moved_aside_and_measured_anew():
    for damage in ("truncated", "no HDF5", "empty", "NaN", "negative", "folder"):
        with exhibit(8, 6) as run:
            whole = made(run)
            path = run.state / "transport.h5"
            if damage == "truncated":
                path.write_bytes(whole[:len(whole) // 2])
            elif damage == "no HDF5":
                path.write_bytes(b"not a transport")
            elif damage == "empty":
                path.write_bytes(b"")
            elif damage == "folder":
                path.unlink()
                path.mkdir()
            else:
                with h5py.File(path, "r+") as file:
                    file["dense"][0, 3, 4] = float("nan") if damage == "NaN" else -5
            spoiled = path.read_bytes() if path.is_file() else None
            run.start()
            status = run.wait_state("showing")
            assert status["frame"]["compensated"], damage
            aside = list(run.state.glob("transport.h5.bad-*"))
            assert len(aside) == 1, (damage, run.said())
            assert spoiled is None or aside[0].read_bytes() == spoiled
            assert "stored transport cannot be used" in run.said()
            with h5py.File(path) as file:
                assert numpy.isfinite(file["dense"][:]).all()


def a_transport_that_breaks_the_reader_is_moved_aside():
    """HDF5 does not survive every flipped byte in its heap of texts: the daemon must, and show its picture."""
    with exhibit(8, 6) as run:
        whole = made(run)
        path = run.state / "transport.h5"
        heap = whole.index(b"GCOL")
        for place in range(heap + 9, heap + 64):
            spoiled = bytearray(whole)
            spoiled[place] ^= 0xff
            path.write_bytes(spoiled)
            try:
                done = subprocess.run([run.program, "--try-transport", path], capture_output=True, timeout=5)
            except subprocess.TimeoutExpired:
                continue  # a hang breaks the reader too, but a crash is found out sooner
            # a sanitizer ends the program with a report where it would crash
            if done.returncode < 0 or b"Sanitizer" in done.stderr:
                break
        else:
            return "skip: this HDF5 survives every byte that was flipped"
        run.start()
        assert run.wait_state("showing")["frame"]["compensated"]
        aside, = run.state.glob("transport.h5.bad-*")
        assert aside.read_bytes() == spoiled and "stored transport cannot be used" in run.said()
    return None


def probing(daemon):
    """The process by which the daemon finds out whether its transport breaks the reader, or None."""
    for thread in os.listdir(f"/proc/{daemon}/task"):
        with contextlib.suppress(OSError):
            for child in map(int, pathlib.Path(f"/proc/{daemon}/task/{thread}/children").read_text().split()):
                if b"--try-transport" in pathlib.Path(f"/proc/{child}/cmdline").read_bytes():
                    return child
    return None


def a_transport_survives_an_order_to_stop_while_it_is_tried():
    """systemd ends all processes of a service, and so a terminal does."""
    with exhibit(8, 6) as run:
        whole = made(run)
        for number in (signal.SIGTERM, signal.SIGINT):
            run.start()
            os.kill(wait_for("the trial", lambda: probing(run.process.pid), pause=0.001), number)
            run.process.send_signal(number)
            assert run.process.wait() == 0
            assert (run.state / "transport.h5").read_bytes() == whole and not list(run.state.glob("*.bad-*")), run.said()


def a_transport_of_another_grid_or_room_is_not_used():
    with exhibit(8, 6) as run:
        whole = made(run)
        run.write_scene(10, 6)
        run.start()
        status = run.wait_state("showing")
        assert status["transport"]["grid"]["width"] == 10
        assert "is of another rig and not used: its grid is 8 x 6 x 3" in run.said()
        assert (run.state / "transport.h5.old").read_bytes() == whole
        run.stop()
        # The same grid, measured on something else.
        with h5py.File(run.state / "transport.h5", "r+") as file:
            file.attrs["source"] = "another room"
        run.start()
        assert run.wait_state("showing")["transport"]["source"] != "another room"
        assert 'it was measured on "another room"' in run.said()
        assert "acquiring" in run.said().rsplit("another room", 1)[1]


def a_transport_that_anyone_wrote_is_used():
    with exhibit(8, 6, channels=1) as run:
        run.state.mkdir()
        dense = numpy.eye(48, dtype=numpy.float32)[None] + 0.004
        with h5py.File(run.state / "transport.h5", "w") as file:
            file.attrs.update(format="counterlight-transport", version=1, width=8, height=6, channels=1)
            file["dense"] = dense
        run.start()
        status = run.wait_state("showing")
        assert status["transport"]["acquired"] is None and status["transport"]["error"] is None, status["transport"]
        assert "acquiring" not in run.said()


def damaged_records_and_drives_do_not_matter():
    for name, text in (("state.json", "{"), ("state.json", '{"content": "../../etc/passwd", "configured": 5}'),
                       ("state.json", "[]"), ("drive.npy", "nothing")):
        with exhibit(8, 6) as run:
            made(run)
            (run.state / name).write_text(text)
            run.start()
            status = run.wait_state("showing")
            assert status["frame"]["compensated"] and status["content"].endswith("moon.png")


def a_state_directory_that_cannot_be_written_is_a_warning():
    with exhibit(8, 6) as run:
        options = {}
        run.state.mkdir(mode=0o500)
        if os.getuid() == 0:  # root may write everywhere
            run.folder.chmod(0o777)
            # the source and build trees may lie where only root may look
            run.program = shutil.copy(run.program, run.folder)
            run.content = shutil.copy(run.content, run.folder)
            run.write_config()
            os.chown(run.state, 65534, 65534)
            options = {"user": 65534, "group": 65534, "extra_groups": []}
        run.start(**options)
        status = run.wait_state("showing")
        assert status["frame"]["compensated"] and not os.listdir(run.state)
        assert "nothing will survive a restart" in run.said()
        with run.client() as client, open(run.content, "rb") as file:
            client.ask("subscribe")
            assert client.ask("show", descriptor=file.fileno(), path="moon")["content"] == "moon"
            client.until("showing")
            assert client.refused("snapshot")["code"] == -32000
        code, seconds = run.stop()
        assert code == 0 and seconds < 2


def left_overs_of_a_killed_daemon_are_swept():
    with exhibit(8, 6) as run:
        made(run)
        (run.state / ".new-1-2-transport.h5").write_bytes(b"half")
        (run.state / "mine").write_text("kept")
        run.start()
        run.wait_state("showing")
        assert not (run.state / ".new-1-2-transport.h5").exists()
        assert (run.state / "mine").read_text() == "kept"


if __name__ == "__main__":
    main([damaged_transports_are_moved_aside_and_measured_anew, a_transport_that_breaks_the_reader_is_moved_aside,
          a_transport_survives_an_order_to_stop_while_it_is_tried,
          a_transport_of_another_grid_or_room_is_not_used, a_transport_that_anyone_wrote_is_used,
          damaged_records_and_drives_do_not_matter, a_state_directory_that_cannot_be_written_is_a_warning,
          left_overs_of_a_killed_daemon_are_swept])
