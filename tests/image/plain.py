"""PNG and EXR files made and read with zlib and struct alone, to judge the program's own reading and writing."""
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

import numpy as np

SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # of a pixel, by PNG colour type


def chunk(kind, content):
    return struct.pack('>I', len(content)) + kind + content + struct.pack('>I', zlib.crc32(kind + content))


def png(codes, colour_type, depth=8, extra=(), palette=None):
    """A PNG of codes [height, width, samples]; extra chunks come before the data."""
    height, width, _ = codes.shape
    if depth == 16:
        rows = codes.astype('>u2').tobytes()
    elif depth == 8:
        rows = codes.astype('u1').tobytes()
    else:
        bits = np.unpackbits(codes.astype('u1').reshape(height, width, 1), axis=2)[:, :, 8 - depth:]
        rows = np.packbits(bits.reshape(height, -1), axis=1).tobytes()
    stride = len(rows) // height
    filtered = b''.join(b'\0' + rows[y * stride:(y + 1) * stride] for y in range(height))
    header = struct.pack('>IIBBBBB', width, height, depth, colour_type, 0, 0, 0)
    return (b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) + b''.join(extra)
            + (chunk(b'PLTE', palette.astype('u1').tobytes()) if palette is not None else b'')
            + chunk(b'IDAT', zlib.compress(filtered)) + chunk(b'IEND', b''))


def paeth(a, b, c):
    to_a, to_b, to_c = abs(b - c), abs(a - c), abs(a + b - 2 * c)
    return a if to_a <= to_b and to_a <= to_c else b if to_b <= to_c else c


def unfilter(kind, row, above, step):
    """PNG specification, section 9.2; row and above are arrays of bytes."""
    if kind == 0:
        return row
    if kind == 1:
        return np.cumsum(row.reshape(-1, step), axis=0, dtype='u1').reshape(-1)
    if kind == 2:
        return row + above
    out, above = [0] * step + row.tolist(), [0] * step + above.tolist()  # with a black pixel before the row
    for i in range(step, len(out)):
        a, b = out[i - step], above[i]
        out[i] = (out[i] + ((a + b) // 2 if kind == 3 else paeth(a, b, above[i - step]))) & 255
    return np.array(out[step:], 'u1')


def read_png(path):
    """The code values [height, width, samples] of an 8- or 16-bit PNG without interlacing, and its depth."""
    data = open(path, 'rb').read()
    assert data[:8] == b'\x89PNG\r\n\x1a\n'
    at, packed, header = 8, b'', None
    while at < len(data):
        size, kind = struct.unpack('>I4s', data[at:at + 8])
        content = data[at + 8:at + 8 + size]
        assert struct.unpack('>I', data[at + 8 + size:at + 12 + size])[0] == zlib.crc32(kind + content)
        header = struct.unpack('>IIBBBBB', content) if kind == b'IHDR' else header
        packed += content if kind == b'IDAT' else b''
        at += 12 + size
    width, height, depth, colour_type, _, _, interlaced = header
    assert depth in (8, 16) and colour_type != 3 and not interlaced
    step = SAMPLES[colour_type] * depth // 8
    flat = np.frombuffer(zlib.decompress(packed), 'u1').reshape(height, width * step + 1)
    rows = np.zeros((height + 1, width * step), 'u1')  # with a black row above
    for y in range(height):
        rows[y + 1] = unfilter(flat[y, 0], flat[y, 1:], rows[y], step)
    kind = '>u2' if depth == 16 else 'u1'
    return np.frombuffer(rows[1:].tobytes(), kind).reshape(height, width, -1).astype(int), depth


def exr(image, kind):
    """An uncompressed scan-line EXR (OpenEXR file layout) of image [channels, height, width], kind 'f2' or 'f4'."""
    channels, height, width = image.shape
    names = ['Y'] if channels == 1 else ['B', 'G', 'R']  # in alphabetical order
    planes = image if channels == 1 else image[::-1]

    def attribute(name, what, content):
        return name + b'\0' + what + b'\0' + struct.pack('<I', len(content)) + content

    listing = b''.join(n.encode() + b'\0' + struct.pack('<iB3xii', 1 if kind == 'f2' else 2, 0, 1, 1) for n in names)
    window = struct.pack('<iiii', 0, 0, width - 1, height - 1)
    head = (b'\x76\x2f\x31\x01' + struct.pack('<I', 2) + attribute(b'channels', b'chlist', listing + b'\0')
            + attribute(b'compression', b'compression', b'\0') + attribute(b'dataWindow', b'box2i', window)
            + attribute(b'displayWindow', b'box2i', window) + attribute(b'lineOrder', b'lineOrder', b'\0')
            + attribute(b'pixelAspectRatio', b'float', struct.pack('<f', 1))
            + attribute(b'screenWindowCenter', b'v2f', struct.pack('<ff', 0, 0))
            + attribute(b'screenWindowWidth', b'float', struct.pack('<f', 1)) + b'\0')
    rows = [planes[:, y].astype('<' + kind).tobytes() for y in range(height)]
    begin = len(head) + 8 * height
    offsets = [begin + y * (8 + len(rows[0])) for y in range(height)]
    return (head + struct.pack('<%dQ' % height, *offsets)
            + b''.join(struct.pack('<ii', y, len(row)) + row for y, row in enumerate(rows)))


def srgb_decode(v):
    """IEC 61966-2-1."""
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def srgb_encode(light):
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


class Converter:
    """The program under test, which the script was given; stderr must stay empty, whatever the files hold."""

    def __init__(self):
        self.noise = tempfile.TemporaryFile('w+')
        self.program = subprocess.Popen([sys.argv[1]], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=self.noise)

    def convert(self, source, target, curve='srgb'):
        """Status and message of reading one picture and writing it as another."""
        print(source, target, curve, sep='\t', file=self.program.stdin, flush=True)
        status, _, message = self.program.stdout.readline().partition('\t')
        self.noise.seek(0)
        noise = self.noise.read()
        assert status.isdigit() and message.endswith('\n') and not noise, (source, status, message, noise)
        return int(status), message[:-1]

    def converted(self, source, target, curve='srgb'):
        """Converts where that must succeed."""
        outcome = self.convert(source, target, curve)
        assert outcome == (0, ''), (source, target, curve, outcome)

    def finish(self):
        self.program.stdin.close()
        assert self.program.wait(60) == 0, self.noise.seek(0) or self.noise.read()


def run(*checks):
    """Calls each check with a converter and an empty folder."""
    converter = Converter()
    for check in checks:
        with tempfile.TemporaryDirectory() as folder:
            check(converter, Path(folder))
    converter.finish()
