"""Broken files: each is refused with status 2 and one line that names the file, and nothing is written."""
import struct

import numpy as np

import plain

random = np.random.default_rng(3)


def refused(converter, folder, name, content, *words):
    path, out = folder / name, folder / 'out.npy'
    path.write_bytes(content)
    status, message = converter.convert(path, out)
    assert status == 2 and all(word in message for word in (str(path), *words)), (name, words, status, message)
    assert not out.exists()
    path.unlink()


def cuts(content, count):
    """Lengths at which to cut a file off: the ends, and some between."""
    inner = random.integers(13, len(content) - 4, size=count)
    return sorted({0, 3, 8, 12, len(content) - 1, *map(int, inner)})


def text_of(converter, folder, name):
    refused(converter, folder, name, b'This is a letter and no picture.\n' * 40, 'is no')


def check_png(converter, folder):
    code = random.integers(0, 256, size=(40, 30, 3))
    good = plain.png(code, 2)
    text_of(converter, folder, 'a.png')
    for length in cuts(good, 6):
        refused(converter, folder, 'a.png', good[:length])
    refused(converter, folder, 'a.png', good[:len(good) // 2], 'cut off')
    for at in (40, len(good) // 2, len(good) - 20):  # within IDAT
        refused(converter, folder, 'a.png', good[:at] + bytes([good[at] ^ 64]) + good[at + 1:], 'damaged')
    signature = b'\x89PNG\r\n\x1a\n'
    wide = struct.pack('>IIBBBBB', 40000, 40000, 8, 0, 0, 0, 0)
    refused(converter, folder, 'a.png', signature + plain.chunk(b'IHDR', wide) + plain.chunk(b'IDAT', b'')
            + plain.chunk(b'IEND', b''))
    refused(converter, folder, 'a.png', plain.exr(np.ones((1, 2, 2)), 'f4'), 'is no PNG')


def check_jpeg(converter, folder):
    np.save(folder / 'in.npy', random.uniform(size=(3, 64, 64)).astype('f4'))
    converter.converted(folder / 'in.npy', folder / 'good.jpg')
    good = (folder / 'good.jpg').read_bytes()
    text_of(converter, folder, 'a.jpg')
    for length in cuts(good, 6):
        refused(converter, folder, 'a.jpeg', good[:length])
    refused(converter, folder, 'a.jpg', good[:len(good) // 2], 'cut off')
    refused(converter, folder, 'a.jpg', b'\xff\xd8\xff\xd9', 'cannot be decoded')


def check_exr(converter, folder):
    light = random.normal(size=(3, 20, 30)).astype('f4')
    np.save(folder / 'in.npy', light)
    converter.converted(folder / 'in.npy', folder / 'good.exr')
    text_of(converter, folder, 'a.exr')
    for good in (plain.exr(light, 'f4'), plain.exr(light, 'f2'), (folder / 'good.exr').read_bytes()):
        for length in cuts(good, 4):
            refused(converter, folder, 'a.exr', good[:length])
    light[1, 2, 3] = np.nan
    refused(converter, folder, 'a.exr', plain.exr(light, 'f4'), 'channel 1, row 2, column 3', 'not finite')


def npy(text, samples=b'', version=b'\1\0', length=None):
    return (b'\x93NUMPY' + version + struct.pack('<H', len(text) if length is None else length)
            + text.encode() + samples)


def saved(folder, array):
    np.save(folder / 'made.npy', array)
    return (folder / 'made.npy').read_bytes()


def check_npy(converter, folder):
    array = random.uniform(size=(3, 8, 9)).astype('f4')
    good = saved(folder, array)
    text_of(converter, folder, 'a.npy')
    for length in cuts(good, 8):
        refused(converter, folder, 'a.npy', good[:length])
    refused(converter, folder, 'a.npy', good + b'\0', 'bytes')
    for wrong in (np.nan, np.inf, -np.inf):
        array[2, 7, 4] = wrong
        refused(converter, folder, 'a.npy', saved(folder, array), 'channel 2, row 7, column 4', 'not finite')
    refused(converter, folder, 'a.npy', saved(folder, np.full((2, 2), 1e300)), 'not finite')  # beyond float32
    refused(converter, folder, 'a.npy', saved(folder, np.asfortranarray(array)), 'Fortran')
    for kind in ('>f4', '>f8', 'i4', 'u1', 'f2', 'c8', 'bool', 'U3', [('a', '<f4')]):
        refused(converter, folder, 'a.npy', saved(folder, np.zeros((2, 2), kind)))
    for shape in ((), (5,), (1, 1, 2, 2), (0, 4), (4, 0, 2), (5, 2, 2)):
        refused(converter, folder, 'a.npy', saved(folder, np.zeros(shape, 'f4')))
    check_npy_headers(converter, folder)


def check_npy_headers(converter, folder):
    good = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 1), }"
    four = b'\0\0\0\0'
    (folder / 'in.npy').write_bytes(npy(good, four))
    converter.converted(folder / 'in.npy', folder / 'fine.npy')  # so it is what is changed below that is refused
    shapes = ('(1, 1, 1, 1)', '(-1, -1)', '(1 1)', '[1, 1]', '(1.0, 1)', '(4294967296, 4294967296)', '(,1)', '',
              '(1, 99999999999999999999)', '(32769, 1)', '(32768, 32768, 32768)', '(1, 1', '1')
    for old, new in (*(('(1, 1)', shape) for shape in shapes), ("'shape'", "'form'"), ('False', 'Maybe'),
                     ('False', 'True'), ("'<f4'", '<f4'), ("'<f4'", "'<f4"), ("'<f4'", "'|f4'"), ('<f4', 'x' * 100),
                     ('}', ''), ('{', ''), (', }', ', } x'), (', }', ', }\0x'), (', }', ", 'shape': (1, 1)}"),
                     (', }', ", 'more': 1}"), (': ', '\0 '), (good, '{}'), (good, ''), (good, ' ' * 5000)):
        assert old in good
        refused(converter, folder, 'a.npy', npy(good.replace(old, new), four))
    for version in (b'\0\0', b'\3\0', b'\1\1', b'\xff\xff'):
        refused(converter, folder, 'a.npy', npy(good, four, version), 'version')
    refused(converter, folder, 'a.npy', npy(good, four, length=60000), 'header')
    refused(converter, folder, 'a.npy', b'\x93NUMPY\2\0\xff\xff\xff\xff' + good.encode() + four, 'header')


def check_names(converter, folder):
    for name in ('missing.png', 'missing.jpg', 'missing.exr', 'missing.npy'):
        status, message = converter.convert(folder / name, folder / 'out.npy')
        assert status == 2 and name in message and 'No such file' in message, message
    refused(converter, folder, 'a.gif', b'GIF89a', '.png', '.npy')
    np.save(folder / 'in.npy', np.ones((2, 2)))
    for name in ('no/such/folder/a.png', 'no/such/folder/a.exr', 'a.tiff', 'a'):
        status, message = converter.convert(folder / 'in.npy', folder / name)
        assert status == 2 and str(folder) in message, message
    assert not [entry for entry in folder.iterdir() if entry.name.startswith('.new')]


def check_damage(converter, folder):
    """Bytes changed at random: the picture is read or refused, and the program goes on."""
    light = random.uniform(size=(3, 24, 30)).astype('f4')
    np.save(folder / 'in.npy', light)
    counts = {}
    for ending in ('.png', '.exr', '.npy'):
        path, out = folder / ('a' + ending), folder / 'out.npy'
        converter.converted(folder / 'in.npy', path)
        good = path.read_bytes()
        for length in [len(good)] * 90 + [random.integers(0, len(good)) for _ in range(30)]:
            bad = bytearray(good[:length])
            for at in random.integers(0, random.choice([128, 600, len(good)]), size=random.integers(1, 4)):
                if at < length:
                    bad[at] = random.integers(0, 256)
            path.write_bytes(bad)
            out.unlink(missing_ok=True)
            status, message = converter.convert(path, out)
            assert status in (0, 2) and out.exists() == (status == 0), (ending, status, message)
            assert status == 0 or str(path) in message, message
            assert status != 0 or np.isfinite(np.load(out)).all()
            counts[ending, status] = counts.get((ending, status), 0) + 1
    print(counts)
    assert all(counts[ending, 2] >= 30 for ending in ('.png', '.exr', '.npy')), counts


plain.run(check_png, check_jpeg, check_exr, check_npy, check_names, check_damage)
