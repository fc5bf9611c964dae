"""A film through the window on an X server: which frame stands there is read from the screen, thousands of times. No
frame is torn, none comes back after a later one, what is stale was told as late, and memory stays as it is.

By hand, a whole film: CLT_FILM_S=60 CLT_FILM_SIZE=1920x1080 CLT_FILM_GRID=480x270 CLT_FILM_HZ=60."""
import os
import re
import subprocess
import threading
import time

import film_numbers
from exhibit import exhibit, main, wait_for
from screen import Screen, xvfb
from test_film import make_film, moving, resident_kib

SECONDS = float(os.environ.get("CLT_FILM_S", "4"))
WIDTH, HEIGHT = map(int, os.environ.get("CLT_FILM_SIZE", "640x360").split("x"))
COLUMNS, ROWS = map(int, os.environ.get("CLT_FILM_GRID", "32x18").split("x"))
RATE_HZ = int(os.environ.get("CLT_FILM_HZ", "30"))
SANITIZED = os.environ["CLT_SANITIZED"] == "yes"
LOOK_S = 0.007  # twice a refresh and more: looks take time from the processors that draw


class Watcher(threading.Thread):
    """Reads the strip again and again, each time as it is at one moment."""

    def __init__(self, display):
        super().__init__()
        self.screen, self.ending, self.seen = Screen(display), threading.Event(), []
        self.start()

    def run(self):
        centres = [(2 * block + 1) * HEIGHT // (2 * film_numbers.BLOCKS) for block in range(film_numbers.BLOCKS)]
        while not self.ending.wait(LOOK_S):
            began = time.monotonic()
            strip = self.screen.green(WIDTH // 32, 0, 1, HEIGHT)
            self.seen.append((began, film_numbers.read_numbers(strip[centres, 0])))

    def end(self):
        self.ending.set()
        self.join()
        self.screen.close()
        return self.seen


def count_stale(seen, frames):
    """How many frames stayed until more than one of their successors was due, and the share of the time that this was so.
    What was seen at both ends of the time is left out."""
    counted = film_numbers.unwrap([numbers[0] for _, numbers in seen], seen[0][1][0], frames)
    assert all(after >= before for before, after in zip(counted, counted[1:])), "an older frame came back"
    changes = [when for (when, _), before, after in zip(seen[1:], counted, counted[1:]) if after != before]
    over = [stay - 2 / RATE_HZ for stay in (after - before for before, after in zip(changes, changes[1:]))]
    return sum(one > 1 / 60 for one in over), sum(max(one, 0) for one in over) / (changes[-1] - changes[0])


def learn_room(run):
    run.state.mkdir()
    subprocess.run([os.environ["CLT_PROGRAM"], "acquire", "-q", "--scene", run.folder / "room.cfg", "--scheme", "blocks",
                    "-o", run.state / "transport.h5"], check=True)


def write_station(run, film):
    """A projector that is there and a camera that is not: the stored transport serves."""
    run.config.write_text(f"""
projector = {{ driver = "glfw"; }};
camera = {{ driver = "v4l2"; device = "usb:dead:beef"; }};
rig = {{ width = {COLUMNS}; height = {ROWS}; }};
daemon = {{ content = "{film}"; group = ""; verify_minutes = 0; retry_s = [60, 60]; budget_ms = 12; }};
""")


def the_window_shows_each_frame_whole_and_in_order():
    if os.environ["CLT_WINDOW"] != "yes":
        return "skip: no GLFW or no V4L2 in this build"
    with xvfb(WIDTH, HEIGHT) as display, exhibit(COLUMNS, ROWS) as run:
        if display is None:
            return "skip: Xvfb does not start here"
        frames = 10 * RATE_HZ if SECONDS > 10 else 2 * RATE_HZ
        learn_room(run)
        write_station(run, make_film(run, WIDTH, HEIGHT, RATE_HZ, frames))
        # Mesa's driver is unloaded with its leaks.
        run.start({"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1", "WAYLAND_DISPLAY": "",
                   "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":detect_leaks=0"})
        wait_for("the compensated film", lambda: moving(run)["compensated"] and moving(run)["frames"] > 10)
        before, late = moving(run), run.status()["frame"]["late"]
        watcher, resident = Watcher(display), []
        for _ in range(2):
            time.sleep(SECONDS / 2)
            resident.append(resident_kib(run))
        seen, after, late = watcher.end(), moving(run), run.status()["frame"]["late"] - late
        assert run.stop()[0] == 0
        assert not any(numbers is None for _, numbers in seen), seen
        torn = sum(film_numbers.is_torn(numbers) for _, numbers in seen)
        changed = {key: after[key] - before[key] for key in ("frames", "late", "slow", "skipped", "slipped", "direct")}
        stale, share = count_stale([look for look in seen if not film_numbers.is_torn(look[1])], frames)
        print(f"{len(seen)} looks: {torn} torn, {stale} times stale by more than one ({100 * share:.2f} % of the time); "
              f"frames {changed}, {late} turns late; last {after}; resident {resident} KiB")
        assert torn == 0
        assert stale <= changed["late"] + changed["slow"] + changed["skipped"] + changed["slipped"] + late
        assert SANITIZED or abs(resident[1] / resident[0] - 1) < 0.01, resident
    return None


if __name__ == "__main__":
    main([the_window_shows_each_frame_whole_and_in_order])
