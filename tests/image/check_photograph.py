"""A real photograph: every sample, and the mean linear light of each channel, against a decoder of its own."""
import os
import sys
from pathlib import Path

import numpy as np

import plain

shared = os.environ.get('CLT_SHARED') or Path(__file__).resolve().parents[2] / '../shared'
photograph = Path(shared) / 'data/coffee.png'
if not photograph.exists():
    print('there is no', photograph)
    sys.exit(77)



def check(converter, folder):
    code, depth = plain.read_png(photograph)
    wanted = np.moveaxis(plain.srgb_decode(code[:, :, :3] / ((1 << depth) - 1)), 2, 0)
    converter.converted(photograph, folder / 'out.npy')
    seen = np.load(folder / 'out.npy').astype(float)
    assert seen.shape == wanted.shape == (3, 400, 600), seen.shape
    assert abs(seen - wanted).max() < 3e-8
    means = seen.mean(axis=(1, 2))
    print('mean linear light', means, 'off by', means - wanted.mean(axis=(1, 2)))
    assert abs(means - wanted.mean(axis=(1, 2))).max() < 1e-9
    converter.converted(photograph, folder / 'again.png')
    assert (plain.read_png(folder / 'again.png')[0] == code[:, :, :3]).all()


plain.run(check)
