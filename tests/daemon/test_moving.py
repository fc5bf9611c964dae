"""Content that moves: a film plays, compensated, from the first moment on and through whatever happens."""
import os
import subprocess
import time

import numpy

from exhibit import exhibit, main, wait_for

RETRY = "retry_s = [0.05, 0.4];"


def film(run, width=64, height=48, frames=120, rate=24):
    path = run.folder / "film.avi"
    subprocess.run([os.environ["CLT_MAKE_FILM"], str(path), str(width), str(height), str(frames), str(rate)], check=True)
    return path


def moving(run, check=lambda moved: True, what="a film that moves"):
    def attempt():
        moved = run.status()["frame"]["moving"]
        return moved if moved and check(moved) else None
    return wait_for(what, attempt)


def play(run, path):
    """Starts the daemon with a film; returns when it is compensated."""
    run.write_config(content=path, daemon=RETRY + "budget_ms = 200;")
    run.start()
    run.wait_state("showing")
    moving(run, lambda m: m["compensated"])


def resident(run):
    for line in (run.process_folder() / "status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    raise AssertionError("no VmRSS")


def a_film_plays_and_is_compensated_once_the_room_is_known():
    with exhibit() as run:
        path = film(run)
        run.write_config(content=path, daemon=RETRY + "budget_ms = 200; target_error = 0.01;")
        assert run.run("--check")[0] == 0
        run.start()
        status = run.wait_state("showing")
        assert status["content"] == str(path) and status["frame"]["compensated"], status
        first = moving(run, lambda m: m["compensated"] and m["frames"] > 24)
        began = time.monotonic()
        second = moving(run, lambda m: m["frames"] >= first["frames"] + 96)
        rate = (second["frames"] - first["frames"]) / (time.monotonic() - began)
        assert rate < 24 * 1.3, rate  # paced by the film's clock, which a busy machine slows down
        assert second["direct"] < second["frames"] / 2, second
        second = moving(run, lambda m: m["error"] is not None)
        assert 0 <= second["error"] < 0.2 and second["stages"]["solve_ms"] > 0, second
        assert second["scale"] == 1 and second["offset"] == 0
        assert second["skipped"] + second["late"] <= 2 * second["frames"]


def a_film_plays_uncompensated_without_a_camera():
    with exhibit() as run:
        room = run.folder / "room.cfg"
        room.write_text(room.read_text() + "camera = { faults = { gone_s = 1e6; }; };\n")
        run.write_config(content=film(run), daemon=RETRY)
        run.start()
        moved = moving(run, lambda m: m["frames"] > 24)
        assert not moved["compensated"] and run.status()["state"] != "showing", moved


def scaled_content_says_how_far():
    with exhibit() as run:
        run.write_config(content=film(run), daemon=RETRY + 'budget_ms = 200; out_of_reach = "scale";')
        run.start()
        moved = moving(run, lambda m: m["compensated"] and m["scale"] < 1)
        assert 0.3 < moved["scale"] < 1 and moved["offset"] >= 0, moved


def a_folder_is_shown_picture_by_picture():
    with exhibit() as run:
        folder = run.folder / "pictures"
        folder.mkdir()
        for k in range(3):
            numpy.save(folder / f"{k}.npy", numpy.full((3, 12, 16), 0.1 + 0.2 * k, numpy.float32))
        run.write_config(content=folder, daemon=RETRY + "picture_seconds = 0.3; budget_ms = 200;")
        run.start()
        run.wait_state("showing")
        moved = moving(run, lambda m: m["compensated"] and m["frames"] >= 4)
        assert moved["fps"] < 20, moved


def what_show_brings_stops_the_film_and_reload_starts_it():
    with exhibit() as run:
        still = run.content
        path = film(run)
        play(run, path)
        with run.client() as client:
            client.ask("show", path=str(still))
        status = run.wait_state("showing")
        assert status["frame"]["moving"] is None, status
        run.write_config(content=still, daemon=RETRY)
        with run.client() as client:
            client.ask("reload")
        run.write_config(content=path, daemon=RETRY + "budget_ms = 200;")
        with run.client() as client:
            client.ask("reload")
        moving(run, lambda m: m["compensated"] and m["frames"] > 10)


def solver_place(run):
    """The processors of the thread that solves: it goes behind all others, but for threads that it started itself."""
    threads = sorted(int(path.name) for path in (run.process_folder() / "task").iterdir())
    niceness = [os.getpriority(os.PRIO_PROCESS, thread) for thread in threads]
    return os.sched_getaffinity(threads[niceness.index(max(niceness))])


def what_has_no_time_leaves_a_processor_to_the_film():
    everywhere = os.sched_getaffinity(0)
    if len(everywhere) < 2 or os.getpriority(os.PRIO_PROCESS, 0) > 4:
        return "skip: one processor, or all threads have the last rank"
    with exhibit() as run:
        play(run, film(run))
        with run.client() as client:
            client.ask("tradeoff")  # measured while the film plays
            assert solver_place(run) == everywhere - {max(everywhere)}, (solver_place(run), everywhere)
            client.ask("show", path=str(run.content))
        wait_for("a solver that has all processors", lambda: solver_place(run) == everywhere)
    return None


def subscribers_are_told_and_a_new_transport_is_taken_over():
    with exhibit() as run:
        play(run, film(run))
        with run.client() as client:
            client.ask("subscribe")
            client.ask("reacquire")
            seen = client.until("showing")
            while not any(n["method"] == "frames" for n in seen):
                seen.append(client.next())
        before = moving(run)["frames"]
        moving(run, lambda m: m["compensated"] and m["frames"] != before)


def memory_is_constant_and_it_ends_at_once():
    with exhibit() as run:
        run.write_config(content=film(run, rate=100), daemon=RETRY + "budget_ms = 50;")
        run.start()
        run.wait_state("showing")
        moving(run, lambda m: m["compensated"] and m["frames"] > 100)
        before = resident(run)
        frames = moving(run)["frames"]
        moving(run, lambda m: m["frames"] > frames + 300)
        assert resident(run) <= before * 1.02 + 1024, (before, resident(run))
        code, seconds = run.stop()
        assert code == 0 and seconds < 2, (code, seconds)


def an_input_that_is_missing_is_waited_for():
    with exhibit() as run:
        run.write_config(content="/dev/counterlight-no-such-input", daemon=RETRY)
        code, said = run.run("--check")
        if code == 2 and "no Video4Linux" in said:
            return "skip: no V4L2 in this build"
        assert code == 0, said
        run.start()
        status = run.wait_state("showing")
        assert status["frame"]["compensated"], status
        moved = moving(run, lambda m: m["why"])
        assert "counterlight-no-such-input" in moved["why"] and moved["frames"] == 0, moved
        assert run.said().count("what moves stands still") == 1
        assert run.stop()[0] == 0
    return None


def what_is_no_film_is_refused():
    with exhibit() as run:
        nothing = run.folder / "nothing.mkv"
        nothing.write_text("no film")
        run.write_config(content=nothing)
        code, said = run.run("--check")
        assert code == 2 and "no video that can be decoded" in said, said
        empty = run.folder / "empty"
        empty.mkdir()
        run.write_config(content=empty)
        code, said = run.run("--check")
        assert code == 2 and "no pictures" in said, said


if __name__ == "__main__":
    main([a_film_plays_and_is_compensated_once_the_room_is_known, a_film_plays_uncompensated_without_a_camera, scaled_content_says_how_far,
          a_folder_is_shown_picture_by_picture, what_show_brings_stops_the_film_and_reload_starts_it,
          what_has_no_time_leaves_a_processor_to_the_film,
          subscribers_are_told_and_a_new_transport_is_taken_over, memory_is_constant_and_it_ends_at_once,
          an_input_that_is_missing_is_waited_for, what_is_no_film_is_refused])
