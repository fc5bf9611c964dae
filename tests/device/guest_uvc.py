"""A USB camera (simulated, behind the real uvcvideo) that is set and locked, unplugged while a frame is waited for, moved
to another node, and that hangs: it comes back by itself each time, with its settings, and nothing is left behind.

    guest_uvc.py PROBE UVCSIM"""
import os
import signal
import subprocess
import sys
import threading
import time

from guest import Probe, run, wait_until

NAME = "usb:1d6b:0104:CL0001"
SETTINGS = "40 5200 -1 60"  # gain, white balance, focus (it has none), power line
FRAME_S, EXPOSURE_S = 1 / 30, 0.0123
CYCLES = 10


class Camera:
    """The simulated camera: plugged in while its process lives."""

    def __init__(self, program):
        self.program, self.process = program, None

    def plug(self):
        self.process = subprocess.Popen([self.program, "-f", "30", "-s", "CL0001"], stderr=subprocess.DEVNULL)

    def unplug(self):
        self.process.kill()
        self.process.wait()

    def hang_until_restart(self):
        """No more frames, until the stream is started anew."""
        self.process.send_signal(signal.SIGUSR2)

    def hang_until_reset(self):
        """No more frames, until the device is reset on its port."""
        self.process.send_signal(signal.SIGUSR1)


def later(seconds, action):
    timer = threading.Timer(seconds, action)
    timer.start()
    return timer


def node():
    """The node of the camera, by its name in sysfs; None where it is away."""
    for name in sorted(os.listdir("/sys/class/video4linux")):
        with open(f"/sys/class/video4linux/{name}/name", encoding="utf-8") as file:
            if file.read().startswith("UVC"):
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


def control_is_set_and_locked(probe, camera):
    assert probe.open("auto")["status"] == "gone"
    camera.plug()
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
    """Time stamps are of this machine's clock, a frame apart, and none begins before what was asked for."""
    now = probe.ask("self")["now_ns"]
    _, answer = probe.frame(now + 200_000_000)
    assert answer["exposed_ns"] >= now + 200_000_000
    stamps = [answer]
    for _ in range(30):
        stamps.append(probe.frame(stamps[-1]["exposed_ns"] + 1)[1])
    counts = stamps[-1]["sequence"] - stamps[0]["sequence"]
    period = (stamps[-1]["exposed_ns"] - stamps[0]["exposed_ns"]) * 1e-9 / counts
    assert 0.9 * FRAME_S < period < 1.5 * FRAME_S, period
    late = probe.ask("self")["now_ns"] - stamps[-1]["exposed_ns"]
    assert 0 < late < 2e9, late


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
    later(0.3, camera.unplug).join(0)
    answer = probe.ask(f"next {far} 1.5")
    assert answer["status"] == "gone" and 1.4 < answer["took_s"] < 4, answer
    later(0.2, camera.plug)
    return recover(probe)


def moved(probe, camera):
    """Comes back while another camera has taken its node."""
    before = node()
    camera.unplug()
    assert probe.ask(f"next {2 ** 62} 0.3")["status"] == "gone"
    run("modprobe", "vivid", "n_devs=1", "node_types=0x1", "vid_cap_nr=0")
    wait_until(lambda: os.path.exists("/dev/video0"), "vivid has its node")
    camera.plug()
    took = recover(probe)
    assert node() != before, (node(), before)
    assert probe.ask("list")["status"] == "ok"
    return took


def hung(probe, hang):
    probe.frame()
    hang()
    time.sleep(0.2)
    return recover(probe)


def leaves_nothing(probe, camera):
    """Cycles of all faults: as many descriptors, threads and mappings after the last as after the first."""
    def cycle():
        unplugged(probe, camera)
        hung(probe, camera.hang_until_restart)
        return probe.ask("self")

    cycle()
    first = probe.ask("self")
    for _ in range(CYCLES - 1):
        last = cycle()
    for key in ("fds", "threads", "mappings"):
        assert first[key] == last[key], (first, last)
    assert last["rss_kib"] <= first["rss_kib"] * 1.01, (first, last)
    print(f"{CYCLES} cycles: {last['fds']} descriptors, {last['threads']} threads, {last['mappings']} mappings as after "
          f"the first, memory {first['rss_kib']} -> {last['rss_kib']} KiB")


def main():
    run("modprobe", "vhci-hcd") if not os.path.exists("/sys/devices/platform/vhci_hcd.0") else None
    probe, camera = Probe(sys.argv[1]), Camera(sys.argv[2])
    empty = probe.ask("self")
    control_is_set_and_locked(probe, camera)
    exposure_is_never_claimed_early(probe)
    frames_keep_their_time(probe)
    print(f"unplugged and plugged in: back after {unplugged(probe, camera):.2f} s")
    print(f"hangs until its stream is started anew: back after {hung(probe, camera.hang_until_restart):.2f} s")
    print(f"hangs until it is reset: back after {hung(probe, camera.hang_until_reset):.2f} s")
    leaves_nothing(probe, camera)
    print(f"back under another node after {moved(probe, camera):.2f} s")
    probe.close()
    after = probe.ask("self")
    assert {k: after[k] for k in ("fds", "threads", "mappings")} == \
        {k: empty[k] for k in ("fds", "threads", "mappings")}, (empty, after)
    probe.end()
    camera.unplug()


if __name__ == "__main__":
    main()
