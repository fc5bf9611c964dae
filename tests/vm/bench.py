"""The bench in the guest: a screen, the room before it, and the USB camera in the room."""
import os
import pathlib
import subprocess
import time

import numpy as np

import station
from exhibit import wait_for

SCREEN, CAMERA = (320, 240), (320, 240)
DEVICES = """
projector = {{ driver = "glfw"; }};
camera = {{ driver = "{driver}"; {own} format = "YUYV"; width = {width}; height = {height};
  response = "linear"; }};
"""
OWN = {"v4l2": 'device = "usb:1d6b:0104:CL0001"; rate_hz = 30; gain = 16; white_balance_k = 4600;',
       "libcamera": "gain = 1.0;"}


def devices(driver):
    """The sections of a configuration that name this bench's screen and camera."""
    return DEVICES.format(driver=driver, own=OWN[driver], width=CAMERA[0], height=CAMERA[1])


class Bench:
    """Screen, room and camera. Commands to both go through fifos."""

    def __init__(self, folder, camera, room):
        self.folder = pathlib.Path(folder)
        os.environ["DISPLAY"] = self.start_screen()
        for name in ("room", "camera"):
            os.mkfifo(self.folder / name)
        light = self.folder / "light"
        self.room = subprocess.Popen([room, station.SCENE, light, self.folder / "room"])
        wait_for("the room's light", lambda: light.exists() and light.stat().st_size)
        self.camera = subprocess.Popen([camera, "-w", str(CAMERA[0]), "-h", str(CAMERA[1]), "-l", light,
                                        "-c", self.folder / "camera"])
        wait_for("the camera's node", lambda: any(pathlib.Path("/dev").glob("video*")))

    def start_screen(self):
        read, write = os.pipe()
        self.screen = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", f"{SCREEN[0]}x{SCREEN[1]}x24",
                                        "-nolisten", "tcp", "-fbdir", self.folder], pass_fds=[write],
                                       stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as told:
            return ":" + told.readline().strip()

    def command(self, which, line):
        with open(self.folder / which, "w", encoding="ascii") as fifo:
            fifo.write(line + "\n")

    def save(self):
        path = self.folder / "radiance.npy"
        path.unlink(missing_ok=True)
        self.command("room", f"save {path}")
        wait_for("the room's measurement", path.exists)
        return np.load(path)

    def radiance(self):
        """What the room measures: the exact radiance of every cell, [channels, height, width], of a picture that stays."""
        before, now = None, self.save()
        while before is None or not np.array_equal(before, now):
            time.sleep(0.3)  # some refreshes of the screen
            before, now = now, self.save()
        return now

    def screenshot(self):
        """Every byte of the picture that is on the screen."""
        return np.fromfile(self.folder / "Xvfb_screen0", np.uint8)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in (self.camera, self.room, self.screen):
            process.terminate()
            process.wait(20)
