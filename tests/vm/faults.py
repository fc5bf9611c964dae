"""In the guest: what happens to the camera while the daemon measures. It is unplugged, it hangs, and so again and again."""
import pathlib
import time

import numpy as np

import station

CYCLES, UNDER_WAY = 10, 20  # patterns


def interrupt(there, exhibit, fault):
    """The fault in the midst of the acquisition that is under way; gives the status before."""
    def under_way():
        status = exhibit.status()
        assert status["state"] == "acquiring", status
        return status if status["progress"] and status["progress"]["done"] >= UNDER_WAY else None
    status = station.wait_for("patterns", under_way)
    there.command("camera", fault)
    return status


def unplugged_and_stalled(there, exhibit):
    """Both in one acquisition: while the camera is away the very picture that was up stays up, to the last pixel; when it
    hangs, which ends by a reset only, measuring goes on without anybody's noticing."""
    up, before = there.screenshot(), exhibit.status()["transport"]["acquired"]
    exhibit.ask("reacquire")
    done = interrupt(there, exhibit, "unplug")["progress"]["done"]
    held = exhibit.wait_state("holding")
    assert "usb:1d6b:0104:CL0001" in held["why"] and held["frame"]["compensated"], held
    there.radiance()  # some refreshes of the screen
    assert np.array_equal(there.screenshot(), up), "the picture did not stay"
    there.command("camera", "plug")
    exhibit.wait_state("acquiring")
    said = len(exhibit.said())
    interrupt(there, exhibit, "stall")
    status = exhibit.wait_state("showing", "holding")
    assert status["state"] == "showing" and status["transport"]["acquired"] != before, status
    assert "resetting it" in exhibit.said()[said:] and "the camera is back" in exhibit.said()[said:]
    resumed = exhibit.resumed()
    print(f"{resumed} of {status['transport']['patterns']} patterns from before the camera was unplugged, {done} were observed")
    assert resumed >= done, (resumed, done)
    return station.error_of(there.radiance())


def look_into(process):
    folder = pathlib.Path("/proc", str(process))
    facts = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
    return {"descriptors": len(list((folder / "fd").iterdir())), "mappings": len((folder / "maps").read_text().splitlines()),
            "threads": int(facts["Threads"]), "rss_kib": int(facts["VmRSS"].split()[0])}


def held(process):
    """What the daemon holds: descriptors, mappings, threads, resident memory in KiB; the least of some looks, for it opens
    and closes files meanwhile, and what leaks is there in all of them."""
    looks = []
    for _ in range(5):
        looks.append(look_into(process))
        time.sleep(0.1)
    return {key: min(look[key] for look in looks) for key in looks[0]}


def cycle(there, exhibit):
    """Black and flood are measured; the camera is unplugged and hangs meanwhile, and they are measured all the same."""
    exhibit.ask("reacquire", scope="photometry")
    there.command("camera", "unplug")
    exhibit.wait_state("holding")
    there.command("camera", "plug")
    exhibit.wait_state("acquiring")
    there.command("camera", "stall")
    exhibit.wait_state("showing")
    return held(exhibit.process.pid)


def check(there, exhibit):
    """All of it; what was found."""
    error = unplugged_and_stalled(there, exhibit)
    seen = [cycle(there, exhibit) for _ in range(CYCLES)]
    resets = exhibit.said().count("resetting it")
    assert resets > CYCLES, resets
    first, last = seen[0], seen[-1]
    assert all(last[key] == first[key] for key in ("descriptors", "threads")), seen
    assert abs(last["mappings"] - first["mappings"]) <= 1, seen  # two that come to lie side by side are one
    assert last["rss_kib"] <= 1.01 * first["rss_kib"], seen
    return {"after_faults": error, "resets": resets, "held": last}
