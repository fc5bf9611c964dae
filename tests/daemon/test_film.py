"""A film on the glass: which frame stands there is read from the picture itself, at every refresh. No frame is torn or
older than the one before the one that is due, and memory stays as it is. CLT_FILM_S makes the film longer."""
import os
import pathlib
import re
import subprocess
import time

import numpy

import film_numbers
from exhibit import exhibit, main, wait_for

SECONDS = float(os.environ.get("CLT_FILM_S", "20"))
SANITIZED = os.environ["CLT_SANITIZED"] == "yes"
RETRY = "retry_s = [0.05, 0.4];"


def make_film(run, width, height, rate, frames):
    path = run.folder / "film.avi"
    subprocess.run([os.environ["CLT_MAKE_FILM"], path, str(width), str(height), str(frames), str(rate), "numbered"],
                   check=True)
    return path


def resident_kib(run):
    return int(re.search(r"VmRSS:\s+(\d+) kB", (run.process_folder() / "status").read_text())[1])


def moving(run):
    return run.status()["frame"]["moving"] or {"frames": 0, "compensated": False}


def look_at_every_refresh(seconds, hiccup_ms):
    """In virtual time, so that each refresh is looked at and nothing but the daemon itself can be late: by how many frames
    each refresh is behind, what the daemon told of the time between, and its memory after a quarter of it and at the end."""
    width, height, rate, frames = 16, 36, 30, 60
    with exhibit(width, height) as run:
        film, glass = make_film(run, 16 * width, 16 * height, rate, frames), run.folder / "glass"
        run.write_config(content=film, daemon=RETRY + "verify_minutes = 0; target_error = 0.01;")
        run.program = os.environ["CLT_DAEMON_GLASS"]
        run.start({"LD_PRELOAD": os.environ["CLT_VIRTUAL_TIME"],
                   "CLT_GLASS": f"{width} {height} {glass}", "CLT_HICCUP_MS": str(hiccup_ms),
                   "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"})
        run.wait_state("showing")
        wait_for("the compensated film", lambda: moving(run)["compensated"])
        with run.client() as client:
            client.ask("tradeoff")  # so that it is no longer being measured
        first = glass.stat().st_size // RECORD.itemsize + 1
        wait_for("a first second", lambda: glass.stat().st_size > RECORD.itemsize * (first + 60))
        before = moving(run)  # while what came before is solved and measured, turns are missed
        resident = []
        for end in (seconds / 4, seconds):
            wait_for("frames", lambda: glass.stat().st_size > RECORD.itemsize * (first + end * 60))
            resident.append(resident_kib(run))
        told = moving(run)
        assert run.stop()[0] == 0
        records = numpy.fromfile(glass, RECORD)
        began, shown = records["shown_ns"][0] * 1e-9, records[first:]
        numbers = [film_numbers.read_numbers(codes) for codes in shown["codes"]]
        assert not any(n is None or film_numbers.is_torn(n) for n in numbers)
        times = shown["shown_ns"] * 1e-9
        due = numpy.floor((times - began) * rate + 1e-6)
        behind = due - film_numbers.unwrap([n[0] for n in numbers], int(due[0]), frames)
        pace = numpy.diff(times)
        print(f"{len(shown)} refreshes: behind by {behind.min():.0f} to {behind.max():.0f} frames, "
              f"{1e3 * pace.min():.1f} to {1e3 * pace.max():.1f} ms apart; {told}")
        assert pace.max() < 1.5 / 60, pace.max()
        return behind, {key: told[key] - before[key] for key in ("late", "slow", "skipped")}, resident


def every_refresh_shows_the_frame_that_is_due():
    behind, told, resident = look_at_every_refresh(SECONDS, 0)
    assert -1 <= behind.min() and behind.max() <= 1
    assert told["skipped"] == 0 and told["late"] == 0, told
    assert SANITIZED or abs(resident[1] / resident[0] - 1) < 0.01, resident


def frames_that_take_long_cost_no_refresh():
    """Every sixteenth takes almost as long as it is begun ahead, which is longer than its own time on the glass."""
    behind, told, _ = look_at_every_refresh(8, 55)
    assert -1 <= behind.min() and behind.max() <= 0, behind
    assert told["slow"] >= 10 and told["skipped"] == 0 and told["late"] == 0, told


RECORD = numpy.dtype([("shown_ns", "<i8"), ("codes", "u1", film_numbers.BLOCKS), ("padding", "u1", 4)])

if __name__ == "__main__":
    main([every_refresh_shows_the_frame_that_is_due, frames_that_take_long_cost_no_refresh])
