"""A station on tests/vm/scene.cfg: its configuration, its calibration, its daemon, and how near it comes to the target."""
import os
import pathlib
import re
import subprocess
import sys

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "daemon"), str(HERE.parent / "image")]
from exhibit import Client, wait_for  # noqa: E402
from plain import png, srgb_decode  # noqa: E402

GRID = (32, 24)
SCENE = HERE / "scene.cfg"
CALIBRATE = ("--levels", "17", "--frames", "3", "--watch", "1")

CONFIG = """
{devices}
rig = {{ width = {grid[0]}; height = {grid[1]}; {calibration} }};
acquire = {{ scheme = "hierarchical"; }};
daemon = {{ content = "content.png"; group = ""; verify_minutes = 0; retry_s = [0.2, 1.0]; }};
"""


def content():
    """Codes of a picture that the scene can show: soft colours, none black and none white."""
    y, x = np.mgrid[0:GRID[1], 0:GRID[0]]
    waves = [np.sin(x / a + y / b) for a, b in ((5.0, 7.0), (7.0, -4.0), (-4.0, 6.0))]
    return np.rint(150 + 35 * np.stack(waves, axis=-1)).astype(np.uint8)


class Station:
    """A folder with configuration, calibration and state; what is measured with it."""

    def __init__(self, folder, counterlight, counterlightd, devices):
        self.folder, self.devices, self.process = pathlib.Path(folder), devices, None
        self.counterlight, self.counterlightd = counterlight, counterlightd
        self.config, self.socket = self.folder / "station.cfg", self.folder / "control.sock"
        (self.folder / "content.png").write_bytes(png(content(), 2))
        self.configure("")

    def configure(self, calibration):
        self.config.write_text(CONFIG.format(devices=self.devices, grid=GRID, calibration=calibration))

    def calibrate(self):
        out = self.folder / "calibration"
        subprocess.run([self.counterlight, "calibrate", "-q", "--config", self.config, "-o", out,
                        *CALIBRATE], check=True, stdout=subprocess.DEVNULL)
        self.configure('calibration = "calibration/calibration.h5";')

    def start(self):
        """glibc maps a large block by itself until the first such block is freed; from then on it keeps up to 32 MiB of such
        blocks, among them the earlier of two transports. A threshold that is given stays, and what is resident is what
        the daemon holds."""
        with open(self.folder / "log", "wb") as log:
            self.process = subprocess.Popen([self.counterlightd, "--config", self.config, "--socket", self.socket,
                                            "--state", self.folder / "state"], stderr=log,
                                            env=dict(os.environ, MALLOC_MMAP_THRESHOLD_=str(1 << 20)))

    def resumed(self):
        """Patterns of the stored transport that were observed before an interruption."""
        with h5py.File(self.folder / "state" / "transport.h5") as file:
            found = re.search(r"(\d+) patterns from before an interruption", str(file.attrs["plan"]))
        return int(found[1]) if found else 0

    def said(self):
        return (self.folder / "log").read_text(errors="replace")

    def status(self):
        assert self.process.poll() is None, "the daemon ended"
        try:
            return self.ask("status")
        except (FileNotFoundError, ConnectionRefusedError):
            return {"state": "starting"}

    def ask(self, method, **parameters):
        with Client(self.socket) as client:
            return client.ask(method, **parameters)

    def wait_state(self, *states):
        def there():
            status = self.status()
            return status if status["state"] in states else None
        # In the guest these are virtual seconds; patterns that are measured again take hundreds of them.
        return wait_for(f"state {'/'.join(states)}", there, 1500)

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if self.process is not None:
            self.process.terminate()
            code = self.process.wait(20)
            print(self.said(), flush=True)
            assert code == 0 or kind is not None, code


def error_of(radiance):
    """Relative RMS from the wanted picture after the best brightness of each channel: units and the colour of white are
    the camera's own."""
    target = srgb_decode(content().transpose(2, 0, 1) / 255.0)
    factors = np.sum(radiance * target, axis=(1, 2)) / np.sum(target * target, axis=(1, 2))
    wanted = factors[:, None, None] * target
    return float(np.linalg.norm(radiance - wanted) / np.linalg.norm(wanted))
