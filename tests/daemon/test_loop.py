"""The closed loop: whether T still fits the room, told by one photograph."""
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


if __name__ == "__main__":
    main([one_photograph_tells_whether_the_transport_fits])
