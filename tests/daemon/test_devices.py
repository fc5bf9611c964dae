"""A camera that is missing, or goes, takes nothing down: the picture stays up and measuring is done when it is back."""
import hashlib
import time

from exhibit import exhibit, main, wait_for

RETRY = "retry_s = [0.05, 0.2];"


def faults(run, text, width=16, height=12):
    """A room whose camera is unplugged as the text says, in seconds of the scene's clock."""
    run.write_scene(width, height)
    room = run.folder / "room.cfg"
    room.write_text(room.read_text() + f"camera = {{ faults = {{ {text} }}; }};\n")


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def picture_goes_on(run):
    """True where the projector is given the picture, refresh after refresh."""
    before = run.status()["frame"]["presented"]
    return wait_for("frames of the picture", lambda: run.status()["frame"]["presented"] > before + 20)


def a_camera_missing_at_the_start_keeps_nothing_dark():
    with exhibit() as run:
        faults(run, "gone_s = 1.5;")
        run.write_config(daemon=RETRY)
        run.start()
        held = wait_for("the uncompensated picture while the camera is missing",
                        lambda: (lambda s: s if s["state"] == "holding" and s["frame"]["presented"] > 0 else None)(
                            run.status()))
        assert "unplugged" in held["why"] and not held["frame"]["compensated"], held
        assert held["devices"]["projector"] == "simulated" and held["devices"]["camera"] is None, held["devices"]
        status = run.wait_state("showing")
        assert status["devices"]["camera"] == "simulated" and status["frame"]["compensated"], status
        assert status["frame"]["fps"] > 30


def a_stored_transport_compensates_without_a_camera():
    with exhibit() as run:
        run.start()
        first = run.wait_state("showing")
        run.stop()
        transport = digest(run.state / "transport.h5")
        (run.state / "drive.npy").unlink()
        faults(run, "gone_s = 1e6;")
        run.write_config(daemon=RETRY)
        run.start()
        status = wait_for("a compensated picture", lambda: (lambda s: s if s["frame"]["compensated"] else None)(
            run.status()))
        assert status["devices"]["camera"] is None, status["devices"]
        assert abs(status["frame"]["error"] - first["frame"]["error"]) < 1e-9, (status["frame"], first["frame"])
        assert status["transport"] == first["transport"]
        wait_for("another try", lambda: "holding" == run.status()["state"])
        assert digest(run.state / "transport.h5") == transport


def a_camera_that_goes_in_mid_acquisition_comes_back_and_it_is_finished():
    with exhibit() as run:
        faults(run, "gone_at_s = 3.0; gone_s = 1.5;")
        run.write_config(daemon=RETRY)
        run.start()
        with run.client() as client:
            client.ask("subscribe")
            seen = client.until("holding")
        states = [n["params"]["state"] for n in seen if n["method"] == "state"]
        assert states[-2] == "acquiring", states
        held = run.status()
        assert "unplugged" in held["why"] or held["state"] != "holding", held
        assert picture_goes_on(run)
        status = run.wait_state("showing")
        assert status["frame"]["compensated"] and status["devices"]["camera"] == "simulated", status
        assert run.said().count("the simulated camera") >= 2, run.said()  # went, and was looked for


def losses_while_the_picture_is_up_leave_it_up():
    with exhibit() as run:
        run.start()
        first = run.wait_state("showing")
        run.stop()
        faults(run, "gone_at_s = 1.0; gone_s = 0.4; gone_every_s = 1.5;")
        run.write_config(daemon="retry_s = [0.05, 0.1]; verify_minutes = 0.005;")
        run.start()
        lost, shown = 0, 0
        with run.client() as client:
            client.ask("subscribe")
            while lost < 5:
                shown += client.until("holding", "showing")[-1]["params"]["state"] == "showing"
                with run.client() as other:
                    status = other.ask("status")
                lost += status["state"] == "holding"
                assert status["frame"]["compensated"], status
                time.sleep(0.05)
        assert picture_goes_on(run)
        assert shown > 0
        descriptors = len(list((run.process_folder() / "fd").iterdir()))
        for _ in range(4):
            with run.client() as client:
                client.ask("subscribe")
                client.until("holding")
        run.wait_state("showing")
        assert len(list((run.process_folder() / "fd").iterdir())) <= descriptors + 1
        assert run.status()["transport"] == first["transport"]


if __name__ == "__main__":
    main([a_camera_missing_at_the_start_keeps_nothing_dark, a_stored_transport_compensates_without_a_camera,
          a_camera_that_goes_in_mid_acquisition_comes_back_and_it_is_finished,
          losses_while_the_picture_is_up_leave_it_up])
