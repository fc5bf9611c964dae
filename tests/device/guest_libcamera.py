"""libcamera in the guest: vimc, and the simulated USB camera behind the real uvcvideo. Frames come, exposures hold, an
unplugged camera is gone and comes back, and nothing is left behind.

    guest_libcamera.py PROBE [UVCSIM]"""
import fcntl
import os
import pathlib
import signal
import subprocess
import sys
import time

SKIP = 77
HUB = pathlib.Path("/sys/devices/platform/vhci_hcd.0")
USB_NAME, VIMC_NAME = "VHCI-1:1.0-1d6b:0104", "Sensor B"


def give_firmware_node():
    """libcamera names a USB camera by the firmware's node of its host, which a virtual host has not: a folder that shows
    the host's own entries, and a node, is laid over it."""
    real, shown = pathlib.Path("/run/hub.real"), pathlib.Path("/run/hub.shown")
    real.mkdir()
    shown.mkdir()
    subprocess.run(["mount", "-n", "--bind", HUB, real], check=True)
    subprocess.run(["mount", "-n", "-t", "tmpfs", "none", shown], check=True)
    for entry in real.iterdir():
        to = shown / entry.name
        if entry.is_symlink():
            to.symlink_to(os.readlink(entry))
            continue
        to.mkdir() if entry.is_dir() else to.touch()
        subprocess.run(["mount", "-n", "--bind", entry, to], check=True)
    (shown / "firmware_node").mkdir()
    (shown / "firmware_node" / "path").write_text("\\_SB_.VHCI\n")
    subprocess.run(["mount", "-n", "--rbind", shown, HUB], check=True)


def has_locks():
    """libcamera takes a camera by a file lock, which a small kernel may lack."""
    with open("/run/lock.probe", "w", encoding="ascii") as file:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX)
        except OSError:
            return False
    return True


class Probe:
    def __init__(self, program):
        self.program = program

    def check(self, *words):
        start = time.monotonic()
        done = subprocess.run([self.program, *map(str, words)], text=True, stdout=subprocess.PIPE, timeout=120)
        print(*words[:2], f"({time.monotonic() - start:.1f} s):", done.stdout.strip().replace("\n", "\n  "))
        assert done.returncode == 0, (words, done.returncode)


def check_usb(probe, simulated):
    subprocess.run(["modprobe", "-a", "vhci-hcd", "uvcvideo"], check=True)
    give_firmware_node()
    plug = [simulated, "-f", "30"]
    camera = subprocess.Popen(plug)
    probe.check(USB_NAME, "return")
    probe.check(USB_NAME, "frames")
    probe.check(USB_NAME, "exposure", "/dev/video0")
    probe.check(USB_NAME, "cycles")
    probe.check(USB_NAME, "unplug", camera.pid)
    camera.wait(10)
    camera = subprocess.Popen(plug)
    probe.check(USB_NAME, "return")
    camera.send_signal(signal.SIGTERM)
    camera.wait(10)


def check_vimc(probe):
    subprocess.run(["modprobe", "vimc"], check=True)
    probe.check(VIMC_NAME, "return")
    probe.check(VIMC_NAME, "frames")
    probe.check(VIMC_NAME, "cycles")


def main():
    if not has_locks():
        print("this kernel has no file locks (CONFIG_FILE_LOCKING), by which libcamera takes a camera")
        return SKIP
    probe = Probe(sys.argv[1])
    if len(sys.argv) > 2:
        check_usb(probe, sys.argv[2])
    check_vimc(probe)
    return 0


if __name__ == "__main__":
    sys.exit(main())
