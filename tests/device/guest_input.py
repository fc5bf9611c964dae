"""The kernel's own test camera (vivid) as content: its colour bars, then shown and compensated by the daemon, whose input
goes and comes back.

    guest_input.py TEST_INPUT COUNTERLIGHTD"""
import os
import pathlib
import subprocess
import sys

from guest import run, wait_until

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "daemon"))
CAMERA, INPUT = "/dev/video0", "/dev/exhibit-input"


def make_camera():
    """Set up before anybody opens it: who shows it keeps others from changing it."""
    run("modprobe", "vivid", "n_devs=1", "node_types=0x1", "num_inputs=1", "input_types=0x3", "vid_cap_nr=0")
    wait_until(lambda: os.path.exists(CAMERA), "vivid has its node")
    run("v4l2-ctl", "-d", CAMERA, "--set-dv-bt-timings=index=0")
    run("v4l2-ctl", "-d", CAMERA, "--set-ctrl", "test_pattern=1,osd_text_mode=2")


def moving(exhibit):
    return exhibit.status()["frame"]["moving"] or {"frames": 0, "compensated": False, "why": None}


def main():
    test_input = os.path.abspath(sys.argv[1])
    sys.argv[1:] = sys.argv[2:]
    from exhibit import exhibit, wait_for
    make_camera()
    with exhibit() as shown:
        shown.write_config(content=INPUT, daemon="retry_s = [0.05, 0.4]; budget_ms = 200;")
        shown.start()
        wait_for("word of the input that is missing", lambda: moving(shown)["why"])
        assert shown.wait_state("showing")["content"] == INPUT
        os.symlink(CAMERA, INPUT)
        first = wait_for("its pictures, compensated",
                         lambda: (lambda m: m if m["compensated"] and m["frames"] > 20 and not m["why"] else None)(
                             moving(shown)))
        print("shown:", first)
        assert "what moves stands still" in shown.said() and "what moves goes on" in shown.said()
        assert shown.stop()[0] == 0
    done = subprocess.run([test_input, INPUT], check=False)
    assert done.returncode == 0, done


if __name__ == "__main__":
    main()
