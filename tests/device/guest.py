"""What the tests inside the guest share: the probe that drives the driver under test, and waiting."""
import json
import os
import subprocess
import tempfile
import time

import numpy as np

AS_IT_IS = "-1 0 -1 -1"  # gain, white balance, focus, power line


class Probe:
    """tests/device/v4l2_probe.c as an object; answers are dictionaries."""

    def __init__(self, program):
        self.file = os.path.join(tempfile.mkdtemp(), "frame.raw")
        self.process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
        self.info = {}

    def send(self, line):
        self.process.stdin.write(line + "\n")

    def receive(self):
        answer = self.process.stdout.readline()
        assert answer, "the probe died"
        return json.loads(answer)

    def ask(self, line):
        self.send(line)
        return self.receive()

    def open(self, device, code="auto", width=0, height=0, rate=0, settings=AS_IT_IS):
        self.info = self.ask(f"open {device} {code} {width} {height} {rate} {settings}")
        return self.info

    def must_open(self, *arguments, **named):
        answer = self.open(*arguments, **named)
        assert answer["status"] == "ok", answer
        return answer

    def frame(self, not_before_ns=0, timeout=5.0):
        """One frame as (height, width, channels), with what the driver says of it."""
        answer = self.ask(f"next {not_before_ns} {timeout} {self.file}")
        assert answer["status"] == "ok", answer
        shape = self.info["height"], self.info["width"], self.info["channels"]
        return np.fromfile(self.file, np.uint16).reshape(shape), answer

    def close(self):
        assert self.ask("close")["status"] == "ok"

    def end(self):
        self.process.stdin.close()
        assert self.process.wait(30) == 0


def wait_until(happens, what, seconds=20):
    start = time.monotonic()
    while not happens():
        assert time.monotonic() - start < seconds, f"waited {seconds} s in vain until {what}"
        time.sleep(0.02)


def run(*command):
    return subprocess.run(command, check=True, text=True, capture_output=True).stdout
