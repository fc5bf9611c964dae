"""An acquisition that is interrupted goes on with what it has, where the room is as it was; else it begins anew."""
import functools
import os
import re
import time

import h5py
import numpy

from exhibit import exhibit, main, wait_for

ROOM = "camera = {{ faults = {{ gone_at_s = {at}; gone_s = 0.6; }}; }};\n"
CONFIRM = 1 + 4 + 1  # white, black, a random picture
FIRST = 1 + 24 + 24  # a random picture, black, white
LOOKS = 4  # at a sum and white after the interruption, and those after it fall elsewhere


def prepare(run, fault="", daemon="retry_s = [0.05, 0.2];"):
    """A room with a fault, and little patience."""
    run.write_scene(32, 24, 1)
    with open(run.folder / "room.cfg", "a") as file:
        file.write(fault)
    run.write_config(daemon=daemon)
    run.config.write_text(run.config.read_text().replace('scheme = "brute";', 'scheme = "brute"; patience_s = 0.3;'))


def measured(run):
    with h5py.File(run.state / "transport.h5") as file:
        return numpy.array(file["dense"][0], float), file.attrs["patterns"], str(file.attrs["plan"])


def progress(run):
    return run.status()["progress"] or {"done": 0, "resumed": 0}


def interrupted_at(run, done):
    """Waits until so many patterns are observed."""
    return wait_for("patterns", lambda: (lambda p: p if p["done"] >= done else None)(progress(run)), pause=0.002)["done"]


@functools.cache
def undisturbed():
    """T, how much two measurements of it differ by the noise of their entries, and the patterns that it took."""
    with exhibit() as run:
        prepare(run)
        run.start()
        run.wait_state("showing")
        assert not (run.state / "acquisition.journal").exists()
        transport, patterns, _ = measured(run)
        with h5py.File(run.state / "transport.h5") as file:
            sigma = numpy.array(file["sigma"][0], float)
        noise = numpy.sqrt(2 * len(sigma) * numpy.sum(sigma**2)) / numpy.linalg.norm(transport)
        return transport, noise, patterns


def off(a, b):
    return numpy.linalg.norm(a - b) / numpy.linalg.norm(b)


def assert_resumed(run, before, known):
    """Went on, and T is what it would have been."""
    transport, noise, whole = known
    seen, patterns, plan = measured(run)
    resumed = int(plan.split("; ")[-1].split(" ")[0]) if "interruption" in plan else 0
    print(f"{resumed} of {patterns} patterns from before; off by {off(seen, transport):.3%}, by noise {noise:.3%}")
    assert resumed >= before and 0 <= patterns - whole - CONFIRM <= LOOKS, (plan, before, patterns, whole)
    assert patterns - resumed < whole - FIRST
    assert off(seen, transport) < noise, (off(seen, transport), noise)
    assert not (run.state / "acquisition.journal").exists()


def a_camera_that_comes_back_goes_on():
    known = undisturbed()
    with exhibit() as run:
        prepare(run, ROOM.format(at=300))
        run.start()
        with run.client() as client:
            client.ask("subscribe")
            why = client.until("holding")[-1]["params"]["why"]
            before = int(re.search(r"pattern (\d+)", why).group(1)) - 1
            assert before > FIRST, why
            client.until("showing")
        assert_resumed(run, before, known)


def kill_and_start(run):
    """Gives what is said from then on."""
    run.stop(9)
    said = len(run.said())
    run.start()
    return lambda: run.said()[said:]


def reacquire(run, done):
    with run.client() as client:
        client.ask("reacquire")
    return interrupted_at(run, done)


def is_acquiring(run):
    """The status while an acquisition is under way that has observed something, else None."""
    status = run.status()
    begun = status["state"] == "acquiring" and status["progress"] is not None and status["progress"]["done"] > 0
    return status if begun else None


def a_daemon_that_was_killed_goes_on():
    """Without a transport; beside one that is stored, which serves meanwhile; but not for ever."""
    known = undisturbed()
    with exhibit() as run:
        prepare(run)
        run.start()
        before = interrupted_at(run, 100)
        kill_and_start(run)
        first = run.wait_state("showing")["transport"]
        assert_resumed(run, before, known)
        before = reacquire(run, 100)
        says = kill_and_start(run)
        status = wait_for("acquiring", lambda: is_acquiring(run))
        assert status["frame"]["compensated"] and status["transport"] == first, status
        assert "goes on (start 1 of at most 3)" in says()
        wait_for("what was measured before", lambda: progress(run)["resumed"] >= before)
        assert run.wait_state("showing")["transport"] != first
        assert_resumed(run, before, known)
        stored = (run.state / "transport.h5").read_bytes()
        reacquire(run, 60)
        for again in range(1, 4):
            says = kill_and_start(run)
            wait_for("acquiring", lambda: is_acquiring(run))
            assert f"goes on (start {again} of at most 3)" in says()
        says = kill_and_start(run)
        run.wait_state("showing")
        assert "is given up that 3 starts went on with" in says() and "acquiring" not in says()
        assert (run.state / "transport.h5").read_bytes() == stored and not list(run.state.glob("acquisition*"))


def what_was_held_goes_on_and_what_is_asked_for_begins_anew():
    with exhibit() as run:
        prepare(run)
        run.start()
        interrupted_at(run, 100)
        with run.client() as client:
            client.ask("hold")
            client.ask("resume")
        run.wait_state("showing")
        assert "interruption" in measured(run)[2]
        with run.client() as client:
            client.ask("reacquire")
        interrupted_at(run, 100)
        with run.client() as client:
            client.ask("hold")
            client.ask("reacquire")
            client.ask("subscribe")
            client.until("showing")
        assert "interruption" not in measured(run)[2]


def a_room_that_changed_meanwhile_begins_anew():
    """A surface is repainted while the camera is away; T is that of the room as it is."""
    change = "change = {{ at_s = {at}; cells = [2, 3, 5, 4]; factor = 0.6; }};\n"
    with exhibit() as run:
        prepare(run, change.format(at=0))
        run.start()
        run.wait_state("showing")
        wanted, whole, _ = measured(run)
    with exhibit() as run:
        prepare(run, ROOM.format(at=300) + change.format(at=300.3))
        run.start()
        run.wait_state("holding")
        run.wait_state("showing")
        seen, patterns, plan = measured(run)
        assert "does not count: under white cells around" in run.said()
        assert "interruption" not in plan and patterns > whole + CONFIRM, (plan, patterns)
        print(f"off by {off(seen, wanted):.3%}")
        assert off(seen, wanted) < 0.01


def another_configuration_or_an_old_journal_begins_anew():
    for what in ("configuration", "scene", "age"):
        with exhibit() as run:
            prepare(run)
            run.start()
            interrupted_at(run, 100)
            run.stop(9)
            journal = run.state / "acquisition.journal"
            assert journal.stat().st_size > 100 * 8 * 32 * 24
            if what == "age":
                os.utime(journal, (time.time() - 4000,) * 2)
            else:
                file = run.config if what == "configuration" else run.folder / "room.cfg"
                file.write_text(file.read_text() + "\n")
            run.start()
            run.wait_state("showing")
            assert "interruption" not in measured(run)[2], what
            assert "is begun anew" in run.said()


if __name__ == "__main__":
    main([a_camera_that_comes_back_goes_on, a_daemon_that_was_killed_goes_on,
          what_was_held_goes_on_and_what_is_asked_for_begins_anew, a_room_that_changed_meanwhile_begins_anew,
          another_configuration_or_an_old_journal_begins_anew])
