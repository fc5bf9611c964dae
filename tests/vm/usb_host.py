"""The guest's USB host, whose devices are programs, as libcamera wants it."""
import os
import pathlib
import subprocess

HOST = pathlib.Path("/sys/devices/platform/vhci_hcd.0")


def give_firmware_node():
    """libcamera names a USB camera by the firmware's node of its host, which a virtual host has not: a folder that shows
    the host's own entries, and a node, is laid over it."""
    real, shown = pathlib.Path("/run/host.real"), pathlib.Path("/run/host.shown")
    real.mkdir()
    shown.mkdir()
    subprocess.run(["mount", "-n", "--bind", HOST, real], check=True)
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
    subprocess.run(["mount", "-n", "--rbind", shown, HOST], check=True)
