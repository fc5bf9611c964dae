"""Measuring again only what changed, by a few photographs."""
import h5py

from exhibit import exhibit, main, wait_for
from test_loop import RETRY, repaint, verified


FIRST_PROGRESS = {"photometry": ("black", 8), "changed": ("black", 10), "geometry": ("structured light", 16)}


def reacquire(run, scope):
    """What the measurement found, and the verification after it."""
    with run.client() as client:
        client.ask("subscribe")
        assert client.ask("reacquire", scope=scope)["state"] == "acquiring"
        notes = client.until("showing", "holding")
    found = [n["params"] for n in notes if n["method"] == "reacquired"]
    made = [n["params"] for n in notes if n["method"] == "progress"]
    assert made and (made[0]["phase"], made[0]["total"]) == FIRST_PROGRESS[scope], made
    status = run.status()
    assert status["state"] == "showing" and found == [status["reacquired"]], (found, status)
    print(scope, found[0])
    return found[0], verified(run)


def entries(run):
    with h5py.File(run.state / "transport.h5") as file:
        return file["dense"][:].astype(float)


def a_repainted_region_is_found_and_its_rows_alone_change():
    with exhibit() as run:
        run.start()
        first = run.wait_state("showing")
        assert first["reacquired"] is None
        found, good = reacquire(run, "changed")
        assert found["done"] == "nothing" and found["fits"] and found["patterns"] == 10, found
        assert run.status()["transport"] == first["transport"]
        old = entries(run)
        run.stop()
        repaint(run)
        run.start()
        run.wait_state("showing")
        bad = verified(run)
        found, after = reacquire(run, "changed")
        assert found["done"] == "repaint" and found["off_before"] > 3 * found["limit"] > 3 * found["off_after"], found
        assert found["patterns"] == 10 < first["transport"]["patterns"] / 15
        assert not bad["fits"] and after["fits"] and after["error"] < 0.6 * bad["error"], (bad, after)
        ratio = (entries(run).sum(2) / old.sum(2)).reshape(3, 12, 16)
        inside = ratio[:, 3:7, 2:7]
        assert abs(inside - 0.6).max() < 0.03, inside
        ratio[:, 3:7, 2:7] = 1
        assert abs(ratio - 1).max() < 0.03 and found["rows"] >= inside.size, (found, ratio)
        assert run.stop()[0] == 0


def a_dimmer_lamp_is_found_by_either_scope():
    with exhibit() as run:
        for scope, intensity in (("photometry", 36), ("changed", 32)):
            run.write_scene(16, 12)
            run.start()
            run.wait_state("showing")
            with run.client() as client:
                client.ask("subscribe")
                client.ask("reacquire", scope="transport")
                client.until("showing")
            old = entries(run)
            run.stop()
            room = (run.folder / "room.cfg").read_text()
            (run.folder / "room.cfg").write_text(room.replace("intensity = 40.0", f"intensity = {intensity}.0"))
            run.start()
            run.wait_state("showing")
            bad = verified(run)
            found, after = reacquire(run, scope)
            assert found["done"] == "gain" and found["fits"] and found["rows"] == 0, found
            assert found["patterns"] == (8 if scope == "photometry" else 10), found
            assert not bad["fits"] and after["fits"] and after["error"] < bad["error"], (bad, after)
            gains = entries(run).sum((1, 2)) / old.sum((1, 2))
            assert abs(gains - intensity / 40).max() < 0.003, gains
            run.stop()


def what_a_few_photographs_do_not_explain_is_measured():
    with exhibit() as run:
        run.start()
        first = run.wait_state("showing")
        run.stop()
        room = (run.folder / "room.cfg").read_text()  # the whole room is darker: its light bounces less
        (run.folder / "room.cfg").write_text(room.replace("albedo = 0.7", "albedo = 0.3"))
        run.write_config(daemon=f'verify_minutes = 0.002; on_misfit = "reacquire"; {RETRY}')
        run.start()
        status = wait_for("another transport", lambda: (lambda s: s if s["reacquired"] else None)(run.status()))
        assert status["reacquired"]["done"] == "transport", status["reacquired"]
        assert status["reacquired"]["patterns"] >= first["transport"]["patterns"] + 10
        wait_for("a fit", lambda: (run.status()["verify"] or {}).get("fits"))


def scopes_that_cannot_be_are_refused():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        with run.client() as client:
            error = client.refused("reacquire", scope="geometry")
            assert error["code"] == -32000 and "no geometry" in error["message"], error
            for scope in ("everything", 5, None):
                error = client.refused("reacquire", scope=scope)
                assert error["code"] == -32602, error
                assert '"transport", "photometry", "geometry" or "changed"' in error["message"], error
            assert client.ask("status")["state"] == "showing"


if __name__ == "__main__":
    main([a_repainted_region_is_found_and_its_rows_alone_change, a_dimmer_lamp_is_found_by_either_scope,
          what_a_few_photographs_do_not_explain_is_measured, scopes_that_cannot_be_are_refused])
