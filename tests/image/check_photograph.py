"""A real photograph: every sample, and the mean linear light of each channel, against a decoder of its own."""
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

import plain

shared = os.environ.get('CLT_SHARED') or Path(__file__).resolve().parents[2] / '../shared'
photograph = Path(shared) / 'data/coffee.png'
if not photograph.exists():
    print('there is no', photograph)
    sys.exit(77)

code, depth = plain.read_png(photograph)
wanted = np.moveaxis(plain.srgb_decode(code[:, :, :3] / ((1 << depth) - 1)), 2, 0)
with tempfile.TemporaryDirectory() as folder:
    out, again = Path(folder) / 'out.npy', Path(folder) / 'again.png'
    plain.converted(photograph, out)
    seen = np.load(out).astype(float)
    plain.converted(photograph, again)
    assert (plain.read_png(again)[0] == code[:, :, :3]).all()
assert seen.shape == wanted.shape == (3, 400, 600), seen.shape
assert abs(seen - wanted).max() < 3e-8
print('mean linear light:', seen.mean(axis=(1, 2)), 'off by', abs(seen.mean(axis=(1, 2)) - wanted.mean(axis=(1, 2))))
assert abs(seen.mean(axis=(1, 2)) - wanted.mean(axis=(1, 2))).max() < 1e-9
