"""The closed loop: whether T still fits the room, told by one photograph, and refining in place."""
import time

import numpy

from exhibit import exhibit, main, wait_for

RETRY = "retry_s = [0.05, 0.4];"


def change_room(run, extra):
    """The room as it is from the next start on."""
    with open(run.folder / "room.cfg", "a") as file:
        file.write(extra)


def repaint(run, factor=0.6):
    change_room(run, f"change = {{ at_s = 0; cells = [2, 3, 5, 4]; factor = {factor}; }};\n")


def verified(run):
    with run.client() as client:
        client.ask("snapshot")  # photographs what is up
        status = client.ask("status")
    return status["verify"]


def one_photograph_tells_whether_the_transport_fits():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        assert run.status()["verify"] is None
        good = verified(run)
        assert good["fits"] and 0 < good["off"] <= good["limit"] and 0 < good["noise"] < good["limit"], good
        assert run.status()["frame"]["verified_error"] == good["error"]
        assert "T fits" in run.said()
        run.stop()
        repaint(run)
        run.start()
        run.wait_state("showing")
        with run.client() as client:
            client.ask("subscribe")
            bad = verified(run)
            note = client.next()
            while note["method"] != "verify":
                note = client.next()
            assert note["params"] == bad, (note, bad)
        assert not bad["fits"] and bad["off"] > 2 * bad["limit"] and bad["error"] > good["error"], (good, bad)
        assert "T no longer fits the room" in run.said()
        print("fits:", good, "repainted:", bad)


def refine(run):
    with run.client() as client:
        client.ask("subscribe")
        assert client.ask("refine")["state"] == "verifying"
        notes = client.until("showing")
        return [n["params"] for n in notes if n["method"] == "verify"][-1]


def refining_corrects_the_picture_in_place():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        assert verified(run)["refined"] is None
        run.stop()
        repaint(run, 0.75)
        run.start()
        run.wait_state("showing")
        before, patterns = verified(run), run.status()["transport"]["patterns"]
        presented = run.status()["frame"]["presented"]
        drive = read_drive(run)
        note = refine(run)
        done = note["refined"]
        print("refined:", before["error"], done)
        assert note["error"] == done["after"] < 0.6 * before["error"], note
        assert 2 <= done["photographs"] <= 16 < patterns / 10 and done["noise"] > 0
        assert abs(read_drive(run) - drive).max() > 5, "the refined drive is not the one that is shown"
        again = verified(run)  # another photograph of the same drive says the same
        assert again["error"] < 1.2 * done["after"] and again["refined"] == done, (again, done)
        wait_for("frames of the refined picture", lambda: run.status()["frame"]["presented"] > presented)
        assert refine(run)["refined"]["after"] <= 1.2 * done["after"]
        assert run.stop()[0] == 0


def a_misfit_refines_where_the_configuration_wants_it():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        run.stop()
        repaint(run, 0.75)
        run.write_config(daemon=f'verify_minutes = 0.002; on_misfit = "refine"; {RETRY}')
        run.start()
        note = wait_for("a refined picture", lambda: (run.status()["verify"] or {}).get("refined"))
        assert note["after"] < 0.6 * note["before"], note
        with run.client() as client:
            assert client.refused("refine", deep=True)["code"] == -32602


def a_drifting_lamp_is_told_by_the_trend():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        assert run.status()["drift"] is None
        run.stop()
        # Half the lamp, so that the error is that of the brightness, and less from second to second of the scene's clock.
        (run.folder / "room.cfg").write_text((run.folder / "room.cfg").read_text().replace(
            "intensity = 40.0;", "intensity = 20.0; drift = { per_hour = -1; };"))
        run.write_config(daemon=f"verify_minutes = 0.0005; drift_limit = 0.5; {RETRY}")
        run.start()
        times, errors, warned = [], [], []
        with run.client() as client:
            client.ask("subscribe")
            while len(times) < 24 or not warned:
                note = client.next()
                if note["method"] == "verify":
                    times.append(time.monotonic() / 3600)
                    errors.append(note["params"]["error"])
                elif note["method"] == "drift":
                    warned.append(note["params"])
            drift = client.ask("status")["drift"]
        print("drift:", drift)
        assert warned[0]["passes"] and warned[0]["photographs"] >= 4 and drift["photographs"] >= 24, (warned, drift)
        slope = numpy.polyfit(times[-24:], errors[-24:], 1)[0]
        assert slope > 0 and abs(drift["error_per_hour"] / slope - 1) < 0.2, (drift, slope)
        assert abs(drift["brightness_per_hour"] / drift["error_per_hour"] + 1) < 0.1, drift
        assert drift["brightness_deviation"] < 0.3 * -drift["brightness_per_hour"], drift
        assert "drift: in an hour" in run.said()


def read_drive(run):
    import test_show
    with run.client() as client:
        return 255 * test_show.read_png(client.ask("snapshot")["drive"])


if __name__ == "__main__":
    main([one_photograph_tells_whether_the_transport_fits, refining_corrects_the_picture_in_place,
          a_misfit_refines_where_the_configuration_wants_it, a_drifting_lamp_is_told_by_the_trend])
