"""libcamera in the guest: vimc, and the simulated USB camera behind the real uvcvideo. Frames come, exposures hold, an
unplugged camera is gone and comes back, and nothing is left behind.

    guest_libcamera.py PROBE CAMERA"""
import fcntl
import pathlib
import signal
import struct
import subprocess
import sys

import numpy as np

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "vm"))
from usb_host import give_firmware_node  # noqa: E402

SKIP = 77
WIDTH, HEIGHT = 720, 480
USB_NAME, VIMC_NAME = "VHCI-1:1.0-1d6b:0104", "Sensor B"


def has_locks():
    """libcamera takes a camera by a file lock, which a small kernel may lack."""
    with open("/run/lock.probe", "w", encoding="ascii") as file:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX)
        except OSError:
            return False
    return True


def make_light(path):
    """A radiance of 1 everywhere, for ever (tests/vm/light.h)."""
    slots, slot = 8, np.ones(HEIGHT * WIDTH * 3, np.float32)
    with open(path, "wb") as file:
        file.write(struct.pack("<3I4x8q", WIDTH, HEIGHT, 1, *[0] * slots))
        file.write(slot.tobytes())
        file.truncate(file.tell() + (slots - 1) * slot.nbytes)


def check(probe, name, *checks):
    subprocess.run([probe, name, *checks], check=True, timeout=120)


def check_usb(probe, simulated):
    subprocess.run(["modprobe", "-a", "vhci-hcd", "uvcvideo"], check=True)
    give_firmware_node()
    make_light("/run/light")
    plug = [simulated, "-w", str(WIDTH), "-h", str(HEIGHT), "-l", "/run/light"]
    camera = subprocess.Popen(plug)
    check(probe, USB_NAME, "return", "frames", "exposure=/dev/video0", "cycles", f"unplug={camera.pid}")
    camera.wait(10)
    camera = subprocess.Popen(plug)
    check(probe, USB_NAME, "return")
    camera.send_signal(signal.SIGTERM)
    camera.wait(10)


def check_vimc(probe):
    subprocess.run(["modprobe", "vimc"], check=True)
    check(probe, VIMC_NAME, "return", "frames", "cycles")


def main():
    if not has_locks():
        print("this kernel has no file locks (CONFIG_FILE_LOCKING), by which libcamera takes a camera")
        return SKIP
    check_usb(*sys.argv[1:3])
    check_vimc(sys.argv[1])
    return 0


if __name__ == "__main__":
    sys.exit(main())
