"""What the whole-path tests share: running the program, pictures without an imaging library, transports and errors
computed by numpy alone."""
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

import h5py
import numpy as np

PROGRAM = sys.argv[1]
SOURCE = pathlib.Path(sys.argv[2])
SHARED = pathlib.Path(os.environ.get("CLT_SHARED", SOURCE / ".." / "shared"))


def run(*words, timeout=300):
    return subprocess.run([PROGRAM, *map(str, words)], text=True, capture_output=True, timeout=timeout)


def answer_of(*words, timeout=300):
    """The JSON document of a command that must succeed with nothing to complain about."""
    done = run(*words, "--json", timeout=timeout)
    assert (done.returncode, done.stderr) == (0, ""), (words, done.returncode, done.stderr)
    return json.loads(done.stdout)


def decode_srgb(code):
    code = np.clip(np.asarray(code, float), 0, 1)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def encode_srgb(light):
    light = np.clip(np.asarray(light, float), 0, 1)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


def write_png(path, codes):
    """Codes 0..1, [channels, height, width] with 1 or 3 channels, as 8 bit."""
    samples = np.round(np.clip(codes, 0, 1) * 255).astype(np.uint8).transpose(1, 2, 0)
    height, width, channels = samples.shape
    rows = b"".join(b"\0" + row.tobytes() for row in samples)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2 if channels == 3 else 0, 0, 0, 0)
    pathlib.Path(path).write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) +
                                   chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def unfilter(kind, line, above, step):
    """One row of a PNG, filter types 0..4 (ISO/IEC 15948, 9.2)."""
    out = bytearray(line)
    for i in range(len(out)):
        a = out[i - step] if i >= step else 0
        b, c = above[i], above[i - step] if i >= step else 0
        p = a + b - c
        paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out[i] = (out[i] + (0, a, b, (a + b) // 2, paeth)[kind]) & 255
    return out


def read_png(path):
    """Codes 0..1, [channels, height, width], of an 8 bit grey or RGB file."""
    data = pathlib.Path(path).read_bytes()
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", data[at + 8:at + 18])
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += 12 + size
    assert depth == 8 and colour in (0, 2), (depth, colour)
    channels, raw = (3 if colour == 2 else 1), zlib.decompress(packed)
    row, rows = width * channels, [bytes(width * channels)]
    for y in range(height):
        line = raw[y * (row + 1):(y + 1) * (row + 1)]
        rows.append(unfilter(line[0], line[1:], rows[-1], channels))
    return np.array([list(r) for r in rows[1:]], float).reshape(height, width, channels).transpose(2, 0, 1) / 255


def write_transport(path, dense, width, height, black=None):
    """A transport as anybody writes it: dense [channels, rows, width * height]."""
    with h5py.File(path, "w") as file:
        file["dense"] = dense.astype("f4")
        file["black"] = np.zeros(dense.shape[:2], "f4") if black is None else black.astype("f4")
        file.attrs["format"], file.attrs["version"] = "counterlight-transport", 1
        file.attrs["width"], file.attrs["height"], file.attrs["channels"] = width, height, dense.shape[0]


def room(width, height, channels, radius, seed=1):
    """A diffuse room with known interreflection: T = (I - A)^-1 F with a symmetric kernel of the given spectral radius."""
    random = np.random.default_rng(seed)
    y, x = np.divmod(np.arange(width * height), width)
    distance = np.hypot((x[:, None] - x) / width, (y[:, None] - y) / height)
    kernel = 1 / (0.15 + distance ** 2)
    np.fill_diagonal(kernel, 0)
    kernel /= np.linalg.eigvalsh(kernel)[-1]
    first = random.uniform(0.8, 1.2, (channels, width * height))
    inverse = np.linalg.inv(np.eye(width * height) - radius * kernel)
    return np.stack([inverse * first[c] for c in range(channels)])


def appearance(dense, black, drive):
    """b0 + T x, [channels, rows], for a drive [channels, height, width]."""
    channels = dense.shape[0]
    return black + np.einsum("cij,cj->ci", dense.astype(float), np.asarray(drive, float).reshape(channels, -1))


def relative_error(seen, target):
    return float(np.linalg.norm(seen - target) / np.linalg.norm(target))


def best_gain(seen, target):
    return float((seen * target).sum() / (seen * seen).sum())


class PathTest(unittest.TestCase):
    """A test with a folder of its own."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="counterlight-path-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def refused(self, *words, code=2, names=""):
        """Runs a command that must fail with one line on stderr, nothing on stdout, and no file touched."""
        before = self.files()
        done = run(*words)
        self.assertEqual(done.returncode, code, (words, done.stderr))
        self.assertEqual(done.stdout, "", words)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertTrue(done.stderr.startswith("counterlight "), done.stderr)
        self.assertIn(str(names), done.stderr)
        self.assertEqual(self.files(), before, words)
        return done.stderr

    def files(self):
        return {p.relative_to(self.folder): p.read_bytes() for p in self.folder.rglob("*") if p.is_file()}


def main():
    unittest.main(argv=sys.argv[:1], verbosity=0)
