"""Good files: what numpy wrote is read, what the program writes numpy reads; PNG and EXR against plain.py."""
import io
import struct

import numpy as np

import plain

random = np.random.default_rng(7)


def read(converter, folder, name, content, curve='srgb'):
    """The picture that the program sees in a file of this content."""
    (folder / name).write_bytes(content)
    converter.converted(folder / name, folder / 'out.npy', curve)
    return np.load(folder / 'out.npy')


def npy(array, version):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, version=version)
    return stream.getvalue()


def npy_by_hand(text, array):
    return b'\x93NUMPY\1\0' + struct.pack('<H', len(text)) + text.encode() + array.tobytes()


def check_npy(converter, folder):
    for kind in ('<f4', '<f8'):
        for shape in ((5, 9), (1, 5, 9), (3, 8, 6), (4, 1, 1)):
            for version in ((1, 0), (2, 0)):
                array = random.normal(size=shape).astype(kind)
                seen = read(converter, folder, 'in.npy', npy(array, version))
                assert seen.dtype == '<f4' and seen.shape == ((1,) + shape)[-3:], (seen.dtype, seen.shape)
                assert (seen == array.astype('<f4').reshape(seen.shape)).all()
    array = random.normal(size=(2, 3)).astype('<f4')
    for text in ("{'shape':(2,3),'descr':\"<f4\",'fortran_order':False}",
                 "  { 'fortran_order' : False , 'shape' : ( 2 , 3 , ) , 'descr' : '<f4' , } \n"):
        assert (read(converter, folder, 'in.npy', npy_by_hand(text, array))[0] == array).all()
    with open(folder / 'out.npy', 'rb') as stream:  # what was written last
        assert np.lib.format.read_magic(stream) == (1, 0)
        assert np.lib.format.read_array_header_1_0(stream) == ((1, 2, 3), False, np.dtype('<f4'))
        assert stream.tell() % 64 == 0


def codes(height, width, samples, depth):
    return random.integers(0, 1 << depth, size=(height, width, samples))


def planes(code, depth):
    return np.moveaxis(plain.srgb_decode(code / ((1 << depth) - 1)), 2, 0)


def check_png_reading(converter, folder):
    noise = (plain.chunk(b'iCCP', b'bad\0\0x'), plain.chunk(b'gAMA', struct.pack('>I', 100000)),
             plain.chunk(b'sBIT', b'\3\3\3'), plain.chunk(b'tEXt', b'Comment\0counterlight'))
    for depth in (8, 16):
        for colour_type, kept in ((0, 1), (2, 3), (4, 1), (6, 3)):
            code = codes(9, 14, plain.SAMPLES[colour_type], depth)
            for extra in ((), noise):
                seen = read(converter, folder, 'in.png', plain.png(code, colour_type, depth, extra))
                assert seen.shape == (kept, 9, 14), seen.shape
                assert abs(seen - planes(code, depth)[:kept]).max() < 3e-8
    for depth in (1, 2, 4):
        code = codes(5, 16, 1, depth)
        assert abs(read(converter, folder, 'in.png', plain.png(code, 0, depth)) - planes(code, depth)).max() < 3e-8
    palette, index = codes(200, 3, 1, 8)[:, :, 0], random.integers(0, 200, size=(6, 7, 1))
    seen = read(converter, folder, 'in.png', plain.png(index, 3, 8, palette=palette))
    assert abs(seen - planes(palette[index[:, :, 0]], 8)).max() < 3e-8


def check_curves(converter, folder):
    code = codes(6, 6, 3, 16)
    for curve, exponent in (('linear', 1), ('gamma 2.2', 2.2), ('gamma:1.5', 1.5)):
        seen = read(converter, folder, 'in.png', plain.png(code, 2, 16), curve)
        assert abs(seen - np.moveaxis((code / 65535) ** exponent, 2, 0)).max() < 3e-8


def check_png_writing(converter, folder):
    for channels in (1, 3):
        light = random.uniform(-0.1, 1.1, size=(channels, 24, 33)).astype('f4')
        light[0, :4, :] = np.linspace(0, 0.01, 132).reshape(4, 33)
        np.save(folder / 'in.npy', light)
        for name in ('out.png', 'out.PNG'):
            converter.converted(folder / 'in.npy', folder / name)
            seen, depth = plain.read_png(folder / name)
            wanted = 255 * plain.srgb_encode(np.clip(light.astype(float), 0, 1))
            assert depth == 8 and seen.shape == (24, 33, channels)
            assert abs(np.moveaxis(seen, 2, 0) - wanted).max() <= 0.5 + 1e-5
    code = np.arange(768).reshape(16, 16, 3) % 256
    (folder / 'in.png').write_bytes(plain.png(code, 2))
    for curve in ('srgb', 'linear', 'gamma 2.2', 'gamma 5'):
        converter.converted(folder / 'in.png', folder / 'out.png', curve)
        assert (plain.read_png(folder / 'out.png')[0] == code).all()


def check_exr(converter, folder):
    for kind in ('f4', 'f2'):
        for channels in (1, 3):
            light = random.normal(scale=10, size=(channels, 7, 10)).astype(kind).astype('f4')
            assert (read(converter, folder, 'in.exr', plain.exr(light, kind)) == light).all(), (kind, channels)


def check_jpeg(converter, folder):
    flat = np.broadcast_to(np.array([0.8, 0.2, 0.05], 'f4')[:, None, None], (3, 24, 40))
    np.save(folder / 'in.npy', flat)
    converter.converted(folder / 'in.npy', folder / 'out.jpg')
    assert (folder / 'out.jpg').read_bytes()[:3] == b'\xff\xd8\xff'
    converter.converted(folder / 'out.jpg', folder / 'out.npy')
    seen = np.load(folder / 'out.npy')
    assert abs(plain.srgb_encode(seen) - plain.srgb_encode(flat)).max() < 3 / 255
    np.save(folder / 'in.npy', flat[0])
    converter.converted(folder / 'in.npy', folder / 'grey.jpg')
    converter.converted(folder / 'grey.jpg', folder / 'out.npy')
    assert np.load(folder / 'out.npy').shape == (1, 24, 40)


plain.run(check_npy, check_png_reading, check_curves, check_png_writing, check_exr, check_jpeg)
