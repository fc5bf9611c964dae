"""A USB camera (simulated, behind the real uvcvideo) that is set and locked, unplugged while a frame is waited for, moved
to another node, and that hangs: it comes back by itself each time, with its settings, and nothing is left behind.

    guest_uvc.py PROBE CAMERA"""
import os
import subprocess
import sys
import tempfile
import threading
import time

from guest import Probe, run, wait_until

NAME = "usb:1d6b:0104:CL0001"
SETTINGS = "40 5200 -1 60"  # gain, white balance, focus (it has none), power line
FRAME_S, EXPOSURE_S = 1 / 30, 0.0123
CYCLES = 10


class Camera:
    """tests/vm/camera: plugged in from the start, and obeying commands."""

    def __init__(self, program):
        self.fifo = os.path.join(tempfile.mkdtemp(), "commands")
        os.mkfifo(self.fifo)
        self.process = subprocess.Popen([program, "-w", "640", "-h", "480", "-c", self.fifo])

    def command(self, line):
        with open(self.fifo, "w", encoding="ascii") as fifo:
            fifo.write(line + "\n")

    def end(self):
        self.process.terminate()
        assert self.process.wait(20) == 0


def later(seconds, action):
    timer = threading.Timer(seconds, action)
    timer.start()
    return timer


def node():
    """The node of the camera, by its name in sysfs; None where it is away."""
    for name in sorted(os.listdir("/sys/class/video4linux")):
        with open(f"/sys/class/video4linux/{name}/name", encoding="utf-8") as file:
            if file.read().startswith("Simulated camera"):
                return "/dev/" + name
    return None


def settings():
    """What the camera's controls are, as another program reads them."""
    lines = run("v4l2-ctl", "-d", node(), "--list-ctrls").splitlines()
    pairs = (l.split(" 0x")[0].strip() + l[l.index("value=") + 5:] for l in lines if "value=" in l)
    return {k: int(v.split()[0]) for k, v in (p.split("=") for p in pairs)}


def must_be_locked():
    now = settings()
    wanted = {"auto_exposure": 1, "white_balance_automatic": 0, "gain": 40, "white_balance_temperature": 5200,
              "power_line_frequency": 2, "exposure_time_absolute": round(EXPOSURE_S * 1e4)}
    assert {k: now[k] for k in wanted} == wanted, now


def control_is_set_and_locked(probe):
    wait_until(lambda: node() is not None and os.path.exists(node()), "the camera has a node")
    listed = probe.ask("list")["cameras"][0]
    assert listed["stable"] == NAME and listed["usb_mbit_s"] == 480, listed
    assert {s["name"] for s in listed["settings"].values() if s["on"]} == {"White Balance, Automatic", "Auto Exposure"}
    for wrong, word in (("1 9000 -1 -1", "white_balance_k"), ("300 0 -1 -1", "gain"), ("1 0 5 -1", "focus")):
        answer = probe.open(NAME, settings=wrong)
        assert answer["status"] == "bad-input" and word in answer["message"], answer
    assert "MJPG" in probe.open(NAME, "MJPG")["message"]
    assert probe.open(NAME, "YUYV", 800, 600)["status"] == "bad-input"
    assert probe.open("usb:1d6b:0104:OTHER")["status"] == "gone"
    for device in ("auto", "usb:1d6b:0104", "port:1-1", "/dev/video0", NAME):
        probe.must_open(device)
        probe.close()
    info = probe.must_open(NAME, "YUYV", 640, 480, 30, SETTINGS)
    assert abs(info["frame_s"] - FRAME_S) < 1e-4 and info["exposure_max_s"] <= FRAME_S + 1e-9, info
    assert probe.ask("expose 0.2")["status"] == "bad-input"
    assert probe.ask(f"expose {EXPOSURE_S}")["status"] == "ok"
    _, answer = probe.frame()
    assert abs(answer["exposure_s"] - EXPOSURE_S) < 1e-9, answer
    must_be_locked()
    # Who asks for the camera's controls now is refused: nothing changes behind the measurement's back.
    changed = subprocess.run(["v4l2-ctl", "-d", node(), "--set-ctrl", "gain=7"], capture_output=True, check=False)
    assert changed.returncode != 0 and settings()["gain"] == 40


def exposure_is_never_claimed_early(probe):
    """A frame that says the new exposure began after the control was set, with frames between."""
    for k in range(5):
        wanted = 0.001 * (2 + k)
        before = probe.ask("self")["now_ns"]
        assert probe.ask(f"expose {wanted}")["status"] == "ok"
        _, answer = probe.frame()
        assert abs(answer["exposure_s"] - wanted) < 1e-9
        assert answer["exposed_ns"] >= before + 2 * FRAME_S * 1e9, (answer, before)
    probe.ask(f"expose {EXPOSURE_S}")
    probe.frame()


def frames_keep_their_time(probe):
    """Time stamps are of this machine's clock and ascend; none begins before what was asked for, none is of the future."""
    now = probe.ask("self")["now_ns"]
    _, before = probe.frame(now + 200_000_000)
    assert before["exposed_ns"] >= now + 200_000_000
    for _ in range(30):
        _, answer = probe.frame(before["exposed_ns"] + 1)
        assert answer["exposed_ns"] > before["exposed_ns"] and answer["sequence"] > before["sequence"], (before, answer)
        assert answer["exposed_ns"] < probe.ask("self")["now_ns"]
        before = answer


def recover(probe, timeout=20):
    """A frame of now, after what was done to the camera; tells how long it took."""
    start = time.monotonic()
    now = probe.ask("self")["now_ns"]
    _, answer = probe.frame(now, timeout)
    assert abs(answer["exposure_s"] - EXPOSURE_S) < 1e-9 and answer["exposed_ns"] >= now
    must_be_locked()
    return time.monotonic() - start


def unplugged(probe, camera):
    """In the middle of waiting for a frame far ahead: says that it is gone, in the time that was allowed."""
    far = probe.ask("self")["now_ns"] + 3_600_000_000_000
    away = later(0.3, lambda: camera.command("unplug"))
    answer = probe.ask(f"next {far} 1.5")
    away.join()
    assert answer["status"] == "gone" and answer["took_s"] >= 1.4, answer
    back = later(0.2, lambda: camera.command("plug"))
    took = recover(probe)
    back.join()
    return took


def stalled(probe, camera):
    """Until it is reset on its port, which sets its controls to what they were in the factory."""
    probe.frame()
    camera.command("stall")
    time.sleep(0.2)
    return recover(probe)


def poor(probe, camera):
    """Frames that are cut short, of a wrong size or marked as damaged are left out."""
    for fault in ("short 3", "size 3", "damage 3"):
        _, before = probe.frame(probe.ask("self")["now_ns"])
        camera.command(fault)
        time.sleep(0.05)
        frames = [probe.frame(before["exposed_ns"] + 1)[1]]
        while len(frames) < 6:
            frames.append(probe.frame(frames[-1]["exposed_ns"] + 1)[1])
        left_out = frames[-1]["sequence"] - before["sequence"] - len(frames)
        assert left_out >= 3, (fault, left_out, frames)


def refused(probe, camera):
    """A camera that refuses its exposure control is reset, and the frame has the exposure that was asked for."""
    camera.command("refuse exposure")
    time.sleep(0.1)
    assert probe.ask("expose 0.005")["status"] == "ok"
    _, answer = probe.frame(probe.ask("self")["now_ns"], 20)
    assert abs(answer["exposure_s"] - 0.005) < 1e-9 and settings()["exposure_time_absolute"] == 50, answer
    assert probe.ask(f"expose {EXPOSURE_S}")["status"] == "ok"
    return answer["took_s"]


def moved(probe, camera):
    """Comes back while another camera has taken its node."""
    before = node()
    camera.command("unplug")
    assert probe.ask(f"next {2 ** 62} 0.5")["status"] == "gone"
    run("modprobe", "vivid", "n_devs=1", "node_types=0x1", "vid_cap_nr=0")
    wait_until(lambda: os.path.exists("/dev/video0"), "vivid has its node")
    camera.command("plug")
    took = recover(probe)
    assert node() != before, (node(), before)
    return took


def leaves_nothing(probe, camera):
    """Cycles of faults: as many descriptors, threads and mappings after the last as after the first."""
    seen = []
    for k in range(CYCLES):
        unplugged(probe, camera)
        if k % 5 == 0:  # in between it is well for long enough to be reset at once
            for _ in range(110):
                probe.frame()
            stalled(probe, camera)
        seen.append(probe.ask("self"))
    for key in ("fds", "threads", "mappings"):
        assert len({s[key] for s in seen}) == 1, seen
    first, last = seen[0], seen[-1]
    assert last["rss_kib"] <= first["rss_kib"] * 1.01, seen
    print(f"{CYCLES} cycles: {last['fds']} descriptors, {last['threads']} threads, {last['mappings']} mappings as after "
          f"the first, memory {first['rss_kib']} -> {last['rss_kib']} KiB")


def main():
    probe = Probe(sys.argv[1])
    assert probe.open("auto")["status"] == "gone"
    empty, camera = probe.ask("self"), Camera(sys.argv[2])
    control_is_set_and_locked(probe)
    exposure_is_never_claimed_early(probe)
    frames_keep_their_time(probe)
    print(f"unplugged and plugged in: back after {unplugged(probe, camera):.2f} s")
    print(f"stalled until it is reset: back after {stalled(probe, camera):.2f} s")
    poor(probe, camera)
    leaves_nothing(probe, camera)
    print(f"exposure refused: set by a reset after {refused(probe, camera):.2f} s")
    print(f"back under another node after {moved(probe, camera):.2f} s")
    probe.close()
    after = probe.ask("self")
    for key in ("fds", "threads", "mappings"):
        assert after[key] == empty[key], (empty, after)
    probe.end()
    camera.end()


if __name__ == "__main__":
    main()
