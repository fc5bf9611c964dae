"""Measuring again while the last picture stays up; failures and kills in the middle lose nothing."""
import hashlib
import os
import time

import h5py
import numpy

from exhibit import exhibit, main, wait_for


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def wait_second():
    """The transport's time counts seconds: the next one is later than all that was stored before."""
    now = int(time.time())
    wait_for("the next second", lambda: int(time.time()) > now)


def progress_of(seen):
    return [n["params"] for n in seen if n["method"] == "progress"]


def reacquire_keeps_the_picture_and_ends_with_a_newer_transport():
    with exhibit(24, 18) as run:
        run.start()
        first = run.wait_state("showing")
        transport, drive = digest(run.state / "transport.h5"), digest(run.state / "drive.npy")
        wait_second()
        with run.client() as client, run.client() as other:
            client.ask("subscribe")
            assert client.ask("reacquire", scope="transport")["state"] == "acquiring"
            early = client.next()
            while early["method"] != "progress":
                early = client.next()
            status = other.ask("status")
            assert status["state"] == "acquiring" and status["progress"]["done"] >= 0, status
            assert status["transport"] == first["transport"] and status["frame"]["compensated"]
            assert other.refused("reacquire")["message"] == "cannot reacquire while acquiring"
            drive_now = read_drive_picture(other)
            assert digest(run.state / "transport.h5") == transport and digest(run.state / "drive.npy") == drive
            seen = [early] + client.until("showing")
        states = [n["params"]["state"] for n in seen if n["method"] == "state"]
        assert states == ["solving", "showing"], states
        progress = progress_of(seen)
        assert len(progress) >= 2
        assert all(a["done"] <= b["done"] and a["seconds"] <= b["seconds"] for a, b in zip(progress, progress[1:]))
        assert all(0 <= p["done"] <= p["total"] and p["phase"] for p in progress), progress
        last = run.status()
        assert last["transport"]["acquired"] > first["transport"]["acquired"]
        assert digest(run.state / "transport.h5") != transport
        with run.client() as client:
            after = read_drive_picture(client)
        assert abs(after - drive_now).max() < 40  # the same picture, from another measurement of the same room


def read_drive_picture(client):
    import test_show
    return 255 * test_show.read_png(client.ask("snapshot")["drive"])


def a_kill_in_the_middle_loses_nothing():
    with exhibit(24, 18) as run:
        run.start()
        first = run.wait_state("showing")
        before = digest(run.state / "transport.h5"), digest(run.state / "drive.npy")
        with run.client() as client:
            client.ask("subscribe")
            client.ask("reacquire")
            while client.next()["method"] != "progress":
                pass
        run.stop(9)
        assert run.socket.exists()  # as a killed daemon leaves it
        assert (digest(run.state / "transport.h5"), digest(run.state / "drive.npy")) == before
        run.start()
        again = run.wait_state("acquiring")  # goes on with what was begun (test_resume.py), and shows what is stored
        assert again["transport"] == first["transport"] and again["frame"]["compensated"]
        assert digest(run.state / "transport.h5") == before[0]
        assert "replacing the socket" in run.said()


def kills_at_any_time_leave_a_whole_transport():
    with exhibit(8, 6) as run:
        run.write_config(daemon='at_start = "acquire"; retry_s = [0.05, 0.4];')
        run.start()
        run.wait_state("showing")
        run.stop(9)
        random = numpy.random.default_rng(3)
        for _ in range(8):
            run.start()
            time.sleep(random.uniform(0, 0.5))
            run.stop(9)
            with h5py.File(run.state / "transport.h5") as file:
                assert file["dense"].shape == (3, 48, 48) and numpy.isfinite(file["dense"][:]).all()
        run.start()
        run.wait_state("showing")
        assert not list(run.state.glob(".new-*"))


def hold_ends_an_acquisition_and_the_picture_comes_back():
    with exhibit(24, 18) as run:
        run.start()
        run.wait_state("showing")
        transport = digest(run.state / "transport.h5")
        with run.client() as client:
            client.ask("subscribe")
            client.ask("reacquire")
            while client.next()["method"] != "progress":
                pass
            assert client.ask("hold")["state"] == "holding"
        # The drive is presented again, refresh after refresh.
        before = run.status()["frame"]["presented"]
        wait_for("frames of the picture", lambda: run.status()["frame"]["presented"] > before + 10)
        assert digest(run.state / "transport.h5") == transport
        with run.client() as client:
            client.ask("resume")  # what was owed is measured after all
        status = wait_for("the new transport", lambda: digest(run.state / "transport.h5") != transport
                          and run.wait_state("showing"))
        assert status["frame"]["compensated"]


def a_failing_acquisition_leaves_the_earlier_picture_up():
    with exhibit() as run:
        run.start()
        first = run.wait_state("showing")
        transport, drive = digest(run.state / "transport.h5"), digest(run.state / "drive.npy")
        run.stop()
        run.write_config(station="rig = { timeout_ms = 1; attempts = 1; };")
        run.start()
        run.wait_state("showing")
        with run.client() as client:
            client.ask("subscribe")
            client.ask("reacquire")
            seen = client.until("holding")
            assert seen[-1]["params"]["why"]
            client.until("acquiring")  # tried again by itself
            client.until("holding")
        status = run.status()
        assert status["transport"] == first["transport"] and status["frame"]["compensated"]
        assert (digest(run.state / "transport.h5"), digest(run.state / "drive.npy")) == (transport, drive)
        code, seconds = run.stop()
        assert code == 0 and seconds < 2


def a_changed_room_is_measured_again_where_the_configuration_wants_it():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        run.stop()
        # The wall was painted: the stored transport is wrong by much more than its error.
        room = (run.folder / "room.cfg").read_text()
        (run.folder / "room.cfg").write_text(room.replace("albedo = 0.7", "albedo = 0.4"))
        run.write_config(daemon="verify_minutes = 0.005; reacquire_error = 0.15; retry_s = [0.05, 0.4];")
        before = digest(run.state / "transport.h5")
        run.start()
        wait_for("a new transport", lambda: digest(run.state / "transport.h5") != before)
        def verified():
            status = run.status()
            error = status["frame"]["verified_error"]
            return status if status["state"] == "showing" and error is not None else None
        assert wait_for("a verified picture", verified)["frame"]["verified_error"] < 0.15


def sigterm_ends_it_within_two_seconds_in_every_state():
    with exhibit(24, 18) as run:
        def acquiring():
            run.wait_state("acquiring")
        def early():
            pass
        def showing():
            run.wait_state("showing")
        def reacquiring():
            showing()
            with run.client() as client:
                client.ask("reacquire")
        def verifying():
            showing()
            with run.client() as client:
                client.send(b'{"jsonrpc":"2.0","id":1,"method":"snapshot"}\n')
        def holding():
            showing()
            with run.client() as client:
                client.ask("hold")
        for state in (early, acquiring, showing, reacquiring, verifying, holding):
            for number in (15, 2):
                run.start()
                run.client().close()
                state()
                code, seconds = run.stop(number)
                assert code == 0, (state.__name__, number, code)
                assert seconds < 2, (state.__name__, number, seconds)
                assert not run.socket.exists()
        assert os.access(run.state / "transport.h5", os.R_OK)


def sigterm_ends_it_while_work_goes_on_that_cannot_be_interrupted():
    with exhibit(90, 70, channels=1) as run:  # a scene that takes long to prepare
        run.start()
        run.client().close()
        time.sleep(0.5)
        if run.status()["state"] != "opening":
            return "skip: the scene is prepared too fast here"
        code, seconds = run.stop()
        assert code == 0 and seconds < 2, (code, seconds)
        assert not run.socket.exists()
        assert "cannot be interrupted" in run.said()
        return None


if __name__ == "__main__":
    main([reacquire_keeps_the_picture_and_ends_with_a_newer_transport, a_kill_in_the_middle_loses_nothing, kills_at_any_time_leave_a_whole_transport,
          hold_ends_an_acquisition_and_the_picture_comes_back, a_failing_acquisition_leaves_the_earlier_picture_up,
          a_changed_room_is_measured_again_where_the_configuration_wants_it,
          sigterm_ends_it_within_two_seconds_in_every_state,
          sigterm_ends_it_while_work_goes_on_that_cannot_be_interrupted])
