"""Transport files written by h5py: every style of attribute loads, every malformed one is refused with a reason.

Usage: test_h5py.py SHOW, the built show_transport."""
import json
import os
import subprocess
import sys
import tempfile
import unittest

try:
    import h5py
    import numpy as np
except ImportError:
    sys.exit(77)

SHOW = ''
W, H, C, N = 5, 3, 2, 15


def show(path, *more):
    run = subprocess.run([SHOW, path, *more], capture_output=True, timeout=60)
    if run.stderr:
        raise AssertionError('HDF5 or a sanitizer printed: ' + run.stderr.decode(errors='replace')[-2000:])
    return run.returncode, json.loads(run.stdout)


def entries(rows=N, channels=C, seed=1):
    return np.random.default_rng(seed).random((channels, rows, N)).astype('f4')


def write(path, dense, **attributes):
    """The five lines of docs/transport-file.md."""
    values = {'format': 'counterlight-transport', 'version': 1, 'width': W, 'height': H, 'channels': len(dense)}
    values.update(attributes)
    with h5py.File(path, 'w') as file:
        for name, value in values.items():
            if value is not None:
                file.attrs[name] = value
        file['dense'] = dense


def leaf_terms(leaf):
    """1, u, v and u v of every cell in its leaf."""
    P = np.zeros((N, 4 * len(leaf)))
    for k, (x, y, w, h) in enumerate(leaf):
        for i in range(w * h):
            u, v = (2 * (i % w) + 1) / w - 1, (2 * (i // w) + 1) / h - 1
            P[(y + i // w) * W + x + i % w, 4 * k:4 * k + 4] = 1, u, v, u * v
    return P


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.path = os.path.join(folder.name, 'T.h5')

    def loads(self, dense):
        code, answer = show(self.path)
        self.assertEqual(code, 0, answer)
        dense = np.asarray(dense, 'f4').astype(float)
        rows = dense.shape[1]
        self.assertEqual((answer['rows'], answer['channels']), (rows, len(dense)))
        for c in range(len(dense)):
            np.testing.assert_allclose(answer['forward'][c], dense[c] @ (1.0 + np.arange(N)), rtol=1e-12)
            np.testing.assert_allclose(answer['backward'][c], (1.0 + np.arange(rows)) @ dense[c], rtol=1e-12)
        return answer

    def refused(self, *words):
        code, answer = show(self.path)
        self.assertEqual(code, 2, answer)
        for word in (os.path.basename(self.path),) + words:
            self.assertIn(word, answer['message'])
        self.assertNotIn('\n', answer['message'])


class Accepted(Case):
    def test_five_lines(self):
        dense = entries()
        write(self.path, dense)
        answer = self.loads(dense)
        self.assertEqual(answer['black'], [[0] * N] * C)
        self.assertEqual(answer['flood'], [None] * C)
        self.assertEqual((answer['scheme'], answer['acquired'], answer['error']), ('', 0, -1))

    def test_text_styles(self):
        dense = entries()
        text = 'counterlight-transport'
        for style in (text, text.encode(), np.bytes_(text), np.array(text.encode(), 'S40'), [text], [text.encode()],
                      np.array(text, dtype=h5py.string_dtype('ascii')), np.array(text, dtype=h5py.string_dtype('utf-8')),
                      np.array(text.encode(), dtype=h5py.string_dtype('utf-8', 30))):
            with self.subTest(style=repr(style)):
                write(self.path, dense, format=style, source=style)
                self.assertEqual(self.loads(dense)['source'], text)
        space = h5py.h5t.C_S1.copy()
        space.set_size(30)
        space.set_strpad(h5py.h5t.STR_SPACEPAD)
        write(self.path, dense, format=None)
        with h5py.File(self.path, 'a') as file:
            attribute = h5py.h5a.create(file.id, b'format', space, h5py.h5s.create(h5py.h5s.SCALAR))
            attribute.write(np.array(text.ljust(30).encode(), 'S30'), mtype=space)
        self.loads(dense)

    def test_number_styles(self):
        dense = entries()
        for kind in ('i1', 'u1', '>i2', 'u2', 'i4', '>u4', 'i8', 'u8', 'f4', 'f8'):
            with self.subTest(kind=kind):
                write(self.path, dense, version=np.array(1, kind), width=np.array([W], kind), height=np.array(H, kind),
                      channels=np.array([[C]], kind))
                self.loads(dense)

    def test_value_styles(self):
        whole = (entries() * 100).round()
        for kind in ('f8', '>f4', 'f2', 'i4', 'u1'):
            with self.subTest(kind=kind):
                write(self.path, whole.astype(kind))
                self.loads(whole)
        packed = entries()
        write(self.path, packed)
        with h5py.File(self.path, 'a') as file:
            del file['dense']
            file.create_dataset('dense', data=packed, chunks=(1, 4, 4), compression='gzip', shuffle=True)
        self.loads(packed)

    def test_rows_and_planes(self):
        rows = 23
        dense = entries(rows)
        black = np.random.default_rng(2).random((C, rows))
        sigma = black / 10
        sigma[1, 3] = np.inf
        write(self.path, dense)
        with h5py.File(self.path, 'a') as file:
            file['black'] = black - 0.5
            file['flood'] = black
            file['sigma'] = sigma
        answer = self.loads(dense)
        np.testing.assert_array_equal(answer['black'], (black - 0.5).astype('f4'))
        np.testing.assert_array_equal(answer['flood'], black.astype('f4'))
        self.assertEqual(answer['sigma'][1][3], 'infinite')

    def test_empty_parts(self):
        dense = entries()
        write(self.path, dense, scheme=h5py.Empty('f'), seconds=h5py.Empty('f8'), error=np.nan)
        with h5py.File(self.path, 'a') as file:
            file['black'] = h5py.Empty('f4')
        self.assertEqual(self.loads(dense)['error'], -1)

    def test_provenance(self):
        dense = entries()
        write(self.path, dense, scheme='brute', source='W\u00e4nde' + 'x' * 200, response='\u00e9' * 100,
              acquired=1791234567, patterns=np.uint8(87), frames=261.0, seconds=np.float32(12.5), error=0.25)
        answer = self.loads(dense)
        self.assertEqual(answer['source'], ('W\u00e4nde' + 'x' * 200)[:126])
        self.assertEqual(answer['response'], '\u00e9' * 63)
        self.assertEqual([answer[k] for k in ('scheme', 'acquired', 'patterns', 'frames', 'seconds', 'error')],
                         ['brute', 1791234567, 87, 261, 12.5, 0.25])
        write(self.path, dense, patterns=1e30, frames=-np.inf, acquired=2**64 - 1, seconds=np.inf)
        answer = self.loads(dense)
        self.assertEqual([answer[k] for k in ('acquired', 'patterns', 'frames', 'seconds')], [0, 0, 0, 0])

    def test_text_is_cleaned(self):
        """What comes out is one line of valid UTF-8, whatever went in."""
        dense = entries()
        for raw, wanted in ((b'W\xe4nde', 'W?nde'), (b'a\nb\x1b[1m\x7f', 'a?b?[1m?'), (b'\xc0\xafx', '??x'), (b'\xe2\x82', '??'),
                            (b'\xed\xa0\x80', '???'), (b'\xf4\x90\x80\x80', '????'), (b'\xf5', '?'),
                            ('\u20ac\U0001f4a1\u00e9'.encode(), '\u20ac\U0001f4a1\u00e9')):
            with self.subTest(raw=raw):
                write(self.path, dense, source=np.bytes_(raw))
                self.assertEqual(self.loads(dense)['source'], wanted)

    def test_noise(self):
        dense = entries()
        dense[0, 0, 0], dense[1, 2, 3] = 1, -0.0099
        write(self.path, dense)
        self.loads(dense)

    def test_other_things_in_the_file(self):
        dense = entries()
        write(self.path, dense, comment='mine', table=np.arange(5))
        with h5py.File(self.path, 'a') as file:
            file['notes/list'] = [1, 2, 3]
        self.loads(dense)

    def test_blocks(self):
        """Random parts, one block without flux, against the matrix form in docs/transport-file.md."""
        random = np.random.default_rng(7)
        block, w = np.arange(N) % 4, 0.5 + random.random(N)
        w[block == 3] = 0
        columns, value = random.random((C, 4, N)), random.random((C, 5))
        start, cell = np.minimum(np.arange(N + 1), 5), np.array([3, 3, 0, 14, 7])
        write(self.path, entries())
        with h5py.File(self.path, 'a') as file:
            del file['dense']
            for name, data in (('block', block), ('flux', w), ('column', columns), ('start', start), ('cell', cell),
                               ('value', value)):
                file['blocks/' + name] = data
        w, columns, value = (a.astype('f4').astype(float) for a in (w, columns, value))
        P, D = np.eye(4)[block], w @ np.eye(4)[block]
        E = P * np.divide(1, D, where=D > 0, out=np.zeros(4))
        wanted = []
        for c in range(C):
            uneven = columns[c].T - P @ ((E * w[:, None]).T @ columns[c].T)
            T = (columns[c].T @ E.T + E @ uneven.T) * w
            for i in range(5):
                T[i, cell[i]] += value[c, i]
            wanted.append(T)
        code, answer = show(self.path)
        self.assertEqual((code, answer['storage']), (0, 'blocks'), answer)
        for c in range(C):
            np.testing.assert_allclose(answer['forward'][c], wanted[c] @ (1.0 + np.arange(N)), rtol=1e-10)
            np.testing.assert_allclose(answer['backward'][c], (1.0 + np.arange(N)) @ wanted[c], rtol=1e-10)
        for name, index, bad in (('block', 2, 4), ('flux', 3, -1.0), ('flux', 4, np.inf), ('start', 1, 9),
                                 ('cell', 0, 15), ('column', (1, 2, 3), np.nan), ('value', (0, 1), np.inf)):
            with h5py.File(self.path, 'a') as file:
                kept = file['blocks/' + name][index]
                file['blocks/' + name][index] = bad
            code, answer = show(self.path)
            self.assertEqual(code, 2, (name, answer))
            self.assertIn('/blocks/%s[' % name, answer['message'])
            with h5py.File(self.path, 'a') as file:
                file['blocks/' + name][index] = kept

    def test_hierarchy(self):
        """Random parts over three leaves, against the matrix form in docs/transport-file.md."""
        random = np.random.default_rng(8)
        leaf = np.array([[0, 0, 3, 3], [3, 0, 2, 2], [3, 2, 2, 1]])
        left, right = random.random((C, 12, 2)), random.random((C, 12, 2))
        scale, gather, own, flood = random.random((4, C, N))
        start, cell, value = np.minimum(np.arange(N + 1), 5), np.array([3, 3, 0, 14, 7]), random.random((C, 5))
        parts = {'leaf': leaf, 'left': left, 'right': right, 'scale': scale, 'gather': gather, 'own': own,
                 'flood': flood, 'start': start, 'cell': cell, 'value': value, 'error': [0.001]}
        write(self.path, entries())
        with h5py.File(self.path, 'a') as file:
            del file['dense']
            for name, data in parts.items():
                file['hierarchy/' + name] = data
        f4 = {name: np.asarray(data).astype('f4').astype(float) for name, data in parts.items()}
        P = leaf_terms(leaf)
        code, answer = show(self.path)
        self.assertEqual((code, answer['storage']), (0, 'hierarchy'), answer)
        for c in range(C):
            T = np.diag(f4['own'][c]) + np.outer(f4['flood'][c], np.full(N, 1 / N))
            T += f4['scale'][c][:, None] * (P @ f4['left'][c] @ f4['right'][c].T @ P.T) * f4['gather'][c]
            for i in range(5):
                T[i, cell[i]] += f4['value'][c, i]
            np.testing.assert_allclose(answer['forward'][c], T @ (1.0 + np.arange(N)), rtol=1e-10)
            np.testing.assert_allclose(answer['backward'][c], (1.0 + np.arange(N)) @ T, rtol=1e-10)
        for name, index, bad in (('leaf', (1, 2), 3), ('leaf', (2, 0), -1), ('leaf', (0, 3), 40), ('left', (0, 1, 1), np.nan),
                                 ('right', (1, 3, 0), np.inf), ('scale', (0, 2), np.nan), ('gather', (1, 1), np.inf),
                                 ('own', (0, 0), np.nan), ('flood', (1, 4), np.inf), ('start', 1, 9), ('cell', 0, 15),
                                 ('value', (0, 1), np.inf), ('error', 0, -1.0)):
            with h5py.File(self.path, 'a') as file:
                kept = file['hierarchy/' + name][index]
                file['hierarchy/' + name][index] = bad
            code, answer = show(self.path)
            self.assertEqual(code, 2, (name, answer))
            self.assertIn('/hierarchy/%s[' % name, answer['message'])
            with h5py.File(self.path, 'a') as file:
                file['hierarchy/' + name][index] = kept

    def test_hierarchy_codes(self):
        """Factors in 16 and 8 bits, those of each channel and those that channels share with a core."""
        random = np.random.default_rng(9)
        leaf, R = np.array([[0, 0, 3, 3], [3, 0, 2, 2], [3, 2, 2, 1]]), 40
        P = leaf_terms(leaf)
        for bits, shared in ((16, False), (16, True), (8, False), (8, True), (32, True)):
            sets = 1 if shared else C
            scale, gather, own, flood = random.random((4, C, N)).astype('f4')
            parts = {'leaf': leaf, 'scale': scale, 'gather': gather, 'own': own, 'flood': flood, 'error': [0.001],
                     'start': np.zeros(N + 1, int), 'cell': np.zeros(0, 'i4'), 'value': np.zeros((C, 0), 'f4')}
            factor = {}
            for side in ('left', 'right'):
                if bits == 32:
                    parts[side] = random.random((sets, 12, R)).astype('f4') - 0.5
                    factor[side] = parts[side].astype(float)
                elif bits == 16:
                    parts[side + '16'] = (random.random((sets, 12, R)) - 0.5).astype('f2')
                    parts[side + '16_scale'] = random.random((sets, 12)).astype('f4')
                    factor[side] = parts[side + '16'].astype(float) * parts[side + '16_scale'][..., None]
                else:
                    parts[side + '8'] = random.integers(-127, 128, (sets, 12, R)).astype('i1')
                    parts[side + '8_scale'] = random.random((sets, 12, 2)).astype('f4')
                    factor[side] = parts[side + '8'] * np.repeat(parts[side + '8_scale'].astype(float), 32, 2)[..., :R]
            if shared:
                parts['core'] = random.random((C, R, R)).astype('f4')
            write(self.path, entries())
            with h5py.File(self.path, 'a') as file:
                del file['dense']
                for name, data in parts.items():
                    file['hierarchy/' + name] = data
            code, answer = show(self.path)
            self.assertEqual((code, answer['storage']), (0, 'hierarchy'), answer)
            for c in range(C):
                left, right = (factor[side][0 if shared else c] for side in ('left', 'right'))
                core = parts['core'][c].astype(float) if shared else np.eye(R)
                T = scale[c][:, None] * (P @ left @ core @ right.T @ P.T) * gather[c].astype(float)
                T += np.diag(own[c].astype(float)) + np.outer(flood[c], np.full(N, 1 / N))
                size = np.abs(scale[c][:, None] * (np.abs(P @ left) @ core @ np.abs(P @ right).T) * gather[c]).sum() * N
                np.testing.assert_allclose(answer['forward'][c], T @ (1.0 + np.arange(N)), atol=1e-6 * size, rtol=0)
                np.testing.assert_allclose(answer['backward'][c], (1.0 + np.arange(N)) @ T, atol=1e-6 * size, rtol=0)
            bad = [('core', (1, 2, 3), np.nan, 'core[')] if shared else []
            bad += [('left16_scale', (0, 3), np.inf, 'left16['), ('right16', (0, 1, 5), np.nan, 'right16[')] if bits == 16 else []
            bad += [('right8_scale', (0, 3, 1), np.nan, 'right8[')] if bits == 8 else []
            for name, index, value, told in bad:
                with h5py.File(self.path, 'a') as file:
                    kept = file['hierarchy/' + name][index]
                    file['hierarchy/' + name][index] = value
                code, answer = show(self.path)
                self.assertEqual(code, 2, (name, answer))
                self.assertIn('/hierarchy/' + told, answer['message'])
                with h5py.File(self.path, 'a') as file:
                    file['hierarchy/' + name][index] = kept
            for name in ['core'] * shared + ['left%d_scale' % bits] * (bits < 32):
                with h5py.File(self.path, 'a') as file:
                    kept = file['hierarchy/' + name][:]
                    del file['hierarchy/' + name]
                code, answer = show(self.path)
                self.assertEqual(code, 2, (name, answer))
                self.assertIn('/hierarchy/' + name, answer['message'])
                with h5py.File(self.path, 'a') as file:
                    file['hierarchy/' + name] = kept

    def test_tree(self):
        write(self.path, entries())
        with h5py.File(self.path, 'a') as file:
            del file['dense']
            file['tree/start'] = np.array([0, 2, 2, 5])
            file['tree/node'] = [0, 14, 15, 23, 21]  # two cells; the first 2 x 2 block, the grid, the first 4 x 4 block
            file['tree/value'] = np.array([[1, 2, 3, 4, 5], [6, 7, 8, 9, 10]]) / 16
        code, answer = show(self.path)
        self.assertEqual(code, 0, answer)
        masks = np.zeros((5, H, W))
        masks[0, 0, 0] = masks[1, 2, 4] = masks[2, :2, :2] = masks[3] = masks[4, :, :4] = 1
        for c in range(C):
            value = np.arange(1, 6) + 5 * c
            rows = np.stack([np.tensordot(value[:2], masks[:2], 1), 0 * masks[0], np.tensordot(value[2:], masks[2:], 1)])
            dense = rows.reshape(3, N) / 16
            np.testing.assert_allclose(answer['forward'][c], dense @ (1.0 + np.arange(N)), rtol=1e-14)
            np.testing.assert_allclose(answer['backward'][c], (1.0 + np.arange(3)) @ dense, rtol=1e-14)

    def test_saved_file_reads_back(self):
        dense, copy = entries(), os.path.join(self.folder, 'copy.h5')
        write(self.path, dense, source='W\u00e4nde', acquired=1791234567)
        self.assertEqual(show(self.path, copy), show(copy))
        with h5py.File(copy) as file:
            np.testing.assert_array_equal(file['dense'][:], dense)
            self.assertEqual(file['black'].shape, (C, N))
            self.assertEqual(file.attrs['format'], 'counterlight-transport')
            self.assertEqual(file.attrs['storage'], 'dense')
            self.assertEqual(file.attrs['source'], 'W\u00e4nde')
            self.assertEqual([int(file.attrs[k]) for k in ('version', 'width', 'height', 'channels', 'acquired')],
                             [1, W, H, C, 1791234567])


    def test_rendered_transport(self):
        """A transport from an independent path tracer, written by its own few lines of h5py."""
        here = os.path.dirname(os.path.abspath(__file__))
        shared = os.environ.get('CLT_SHARED', os.path.join(here, '..', '..', '..', 'shared'))
        path = os.path.join(shared, 'data', 'cycles-dihedral.h5')
        if not os.path.exists(path):
            self.skipTest('no ' + path)
        code, answer = show(path)
        self.assertEqual(code, 0, answer)
        with h5py.File(path) as file:
            dense = file['dense'][:].astype(float)
            np.testing.assert_allclose(answer['forward'][0], dense[0] @ (1.0 + np.arange(768)), rtol=1e-12)
            np.testing.assert_array_equal(answer['black'], file['black'][:])
            np.testing.assert_array_equal(answer['flood'], file['flood'][:])


def contact(rows, seed=5):
    """Entries that range over 1e5 along a row, a bright diagonal and noise below zero."""
    random = np.random.default_rng(seed)
    away = np.abs(np.arange(rows)[:, None] - np.arange(N)[None, :])
    light = np.where(away == 0, 0.7, 0.2 * random.random((C, rows, N)) * 10.0 ** (-5 * np.minimum(away / 10, 1)))
    return (light + 1e-5 * (random.random((C, rows, N)) - 0.5)).astype('f4')


class Storages(Case):
    """docs/transport-file.md read by numpy against what the conversion was given, and written by numpy."""

    def convert(self, dense, storage):
        write(self.path, dense)
        copy = os.path.join(self.folder, storage + '.h5')
        code, answer = show(self.path, copy, storage)
        self.assertEqual((code, answer['storage']), (0, storage))
        self.assertEqual(show(copy), (code, answer))
        return h5py.File(copy), answer

    def compare(self, entries, answer, tolerance):
        """The products are those of the entries."""
        rows = entries.shape[1]
        for c in range(C):
            size = np.abs(entries[c]).max() * 400
            np.testing.assert_allclose(answer['forward'][c], entries[c] @ (1.0 + np.arange(N)), atol=tolerance * size)
            np.testing.assert_allclose(answer['backward'][c], (1.0 + np.arange(rows)) @ entries[c], atol=tolerance * size)

    def off_diagonal(self, dense):
        rest = dense.astype(float)
        for i in range(min(rest.shape[1:])):
            rest[:, i, i] = 0
        return rest

    @staticmethod
    def set_diagonal(entries, diagonal):
        for i in range(diagonal.shape[1]):
            entries[:, i, i] = diagonal[:, i]
        return entries

    def test_dense64(self):
        for rows in (N, 23, 9):
            dense = contact(rows)
            file, answer = self.convert(dense, 'dense64')
            with file:
                self.assertEqual(file['dense64'].dtype, np.dtype('f8'))
                np.testing.assert_array_equal(file['dense64'][:], dense.astype(float))
            self.compare(dense.astype(float), answer, 1e-15)

    def test_dense16(self):
        for rows in (N, 23, 9):
            dense = contact(rows)
            file, answer = self.convert(dense, 'dense16')
            with file:
                value, scale, diagonal = (file['dense16'][k][:] for k in ('value', 'scale', 'diagonal'))
            self.assertEqual((value.dtype, scale.shape), (np.dtype('f2'), (C, rows)))
            rest = self.off_diagonal(dense)
            np.testing.assert_array_equal(scale, 2.0 ** (np.frexp(np.abs(rest).max(2))[1] - 15))
            wanted = (rest / scale[..., None]).astype('f2')
            normal = np.abs(wanted) >= 2.0 ** -14
            np.testing.assert_array_equal(value[normal], wanted[normal])
            self.assertTrue((np.abs(value[value != 0]) >= 2.0 ** -14).all())  # nothing is subnormal
            np.testing.assert_array_equal(diagonal, [np.diagonal(d) for d in dense])
            self.compare(self.set_diagonal(value.astype(float) * scale[..., None], diagonal), answer, 1e-7)

    def test_dense8(self):
        for rows in (N, 23, 9):
            dense = contact(rows)
            file, answer = self.convert(dense, 'dense8')
            with file:
                code, scale, offset, diagonal = (file['dense8'][k][:] for k in ('code', 'scale', 'offset', 'diagonal'))
            self.assertEqual((code.dtype, scale.shape, offset.shape), (np.dtype('i1'), (C, rows, 1), (C, rows)))
            rest = self.off_diagonal(dense)
            largest = np.abs(rest).max(2, keepdims=True)
            np.testing.assert_allclose(scale, largest / 127, rtol=1e-6)
            np.testing.assert_array_equal(code, np.rint(rest / scale))
            entries = code * scale.astype(float) + offset[..., None]
            np.testing.assert_allclose(self.off_diagonal(entries).sum(2), rest.sum(2), atol=1e-7 * largest.max())
            np.testing.assert_array_equal(diagonal, [np.diagonal(d) for d in dense])
            self.compare(self.set_diagonal(entries, diagonal), answer, 1e-7)

    def write_parts(self, **parts):
        write(self.path, entries())
        with h5py.File(self.path, 'a') as file:
            del file['dense']
            for name, value in parts.items():
                file[name.replace('_', '/')] = value

    def test_written_by_h5py(self):
        """Other number types are converted; a row may be all zero."""
        value = self.off_diagonal(contact(N)).astype('f4')
        value[0, 3] = 0
        ones = np.ones((C, N))
        self.write_parts(dense16_value=value, dense16_scale=2 * ones, dense16_diagonal=ones.astype('i4'))
        code, answer = show(self.path)
        self.assertEqual((code, answer['storage']), (0, 'dense16'))
        self.compare(self.set_diagonal(2 * value.astype('f2').astype(float), ones), answer, 1e-7)
        codes = np.random.default_rng(8).integers(0, 100, (C, N, N))
        codes[:, range(N), range(N)] = 0
        self.write_parts(dense8_code=codes, dense8_scale=np.full((C, N, 1), 0.01), dense8_offset=0.1 * ones,
                         dense8_diagonal=ones)
        code, answer = show(self.path)
        self.assertEqual((code, answer['storage']), (0, 'dense8'))
        self.compare(self.set_diagonal(0.01 * codes + 0.1, ones), answer, 1e-7)

    def test_refused(self):
        ones, zeros = np.ones((C, N)), np.zeros((C, N, N), 'i1')
        halves = dict(dense16_value=zeros.astype('f2'), dense16_scale=ones, dense16_diagonal=ones)
        codes = dict(dense8_code=zeros, dense8_scale=np.ones((C, N, 1)), dense8_offset=0 * ones, dense8_diagonal=ones)

        def at(array, index, value):
            changed = np.array(array, 'f8')
            changed[index] = value
            return changed

        for good, change, word in (
                (halves, dict(dense16_value=at(zeros, (1, 2, 2), 1)), '/dense16/value[1, 2, 2]'),
                (halves, dict(dense16_value=at(zeros, (1, 2, 3), np.nan).astype('f2')), '/dense16[1, 2, 3]'),
                (halves, dict(dense16_value=at(zeros, (1, 2, 3), np.inf).astype('f2')), '/dense16[1, 2, 3]'),
                (halves, dict(dense16_value=at(zeros, (1, 2, 3), 1e6)), '/dense16[1, 2, 3]'),
                (halves, dict(dense16_value=at(zeros, (1, 2, 3), -0.02).astype('f2')), '/dense16[1, 2, 3]'),
                (halves, dict(dense16_scale=at(ones, (0, 4), np.inf)), '/dense16[0, 4,'),
                (halves, dict(dense16_diagonal=at(ones, (0, 4), np.nan)), '/dense16[0, 4, 4]'),
                (halves, dict(dense16_scale=ones[:, 1:]), '/dense16/scale'),
                (halves, dict(dense16_diagonal=ones[0]), '/dense16/diagonal'),
                (halves, dict(dense16_value=zeros[:, :, 1:]), '/dense16/value'),
                (codes, dict(dense8_code=at(zeros, (1, 2, 2), 1)), '/dense8/code[1, 2, 2]'),
                (codes, dict(dense8_scale=np.ones((C, N, 2))), '/dense8/scale'),
                (codes, dict(dense8_scale=at(np.ones((C, N, 1)), (1, 3, 0), np.nan)), '/dense8[1, 3, 0]'),
                (codes, dict(dense8_offset=at(0 * ones, (1, 3), -1)), '/dense8[1, 3, 0]'),
                (codes, dict(dense8_diagonal=at(ones, (1, 3), np.inf)), '/dense8[1, 3, 3]')):
            with self.subTest(word=word, part=list(change)[0]):
                self.write_parts(**{**good, **change})
                self.refused(word)
        for good in (halves, codes):
            for name in good:
                with self.subTest(missing=name):
                    self.write_parts(**{k: v for k, v in good.items() if k != name})
                    self.refused('/' + name.replace('_', '/'))
        for value, word in ((np.nan, 'NaN'), (np.inf, 'infinite'), (-0.02, '-0.02')):
            self.write_parts(dense64=at(at(zeros, (0, 0, 0), 1), (1, 2, 3), value))
            self.refused('/dense64[1, 2, 3]', word)


class Refused(Case):
    def test_attributes(self):
        cases = [
            (dict(format=None), 'format'), (dict(format='other'), 'format'), (dict(format=7), 'format'),
            (dict(format=['a', 'b']), 'format'), (dict(version=None), 'version'), (dict(version=2), 'version 2'),
            (dict(version=0), 'version'), (dict(version='one'), 'version'), (dict(version=np.nan), 'version'),
            (dict(width=None), 'width'), (dict(width=0), 'width'), (dict(width=-5), '-5'), (dict(width=5.5), '5.5'),
            (dict(width=16385), '16384'), (dict(width=2**40), 'width'), (dict(width=2**63), 'width'),
            (dict(width=[5, 5]), 'width'), (dict(width=np.inf), 'width'), (dict(height='3'), 'height'),
            (dict(height=4), '[2, 15, 15]'), (dict(width=16384, height=16384), '/dense'), (dict(channels=3), '/dense'),
            (dict(channels=5), 'channels'), (dict(channels=0), 'channels'), (dict(source=5), 'source'),
            (dict(seconds='long'), 'seconds'), (dict(patterns=[1, 2]), 'patterns'),
        ]
        for attributes, word in cases:
            with self.subTest(**attributes):
                write(self.path, entries(), **attributes)
                self.refused(word)

    def test_shapes(self):
        cases = [entries()[0], entries()[:, :, 1:], entries()[:, :0], entries()[None], np.float32(1),
                 np.empty((C, 0, N), 'f4')]
        for dense in cases:
            with self.subTest(shape=dense.shape):
                write(self.path, entries())
                with h5py.File(self.path, 'a') as file:
                    del file['dense']
                    file['dense'] = dense
                self.refused()

    def test_values(self):
        for value, word in ((np.nan, 'NaN'), (np.inf, 'infinite'), (-np.inf, 'infinite'), (-0.0101, '-0.01'),
                            (1e300, 'infinite')):
            with self.subTest(value=value):
                dense = entries().astype('f8')
                dense[0, 0, 0] = 1
                dense[1, 2, 3] = value
                write(self.path, dense)
                self.refused('/dense[1, 2, 3]', word)

    def test_planes(self):
        good = np.zeros((C, N))
        for name in ('black', 'flood', 'sigma'):
            for value in (good[:, 1:], good[0], good[:1], np.float32(0)):
                with self.subTest(name=name, shape=np.shape(value)):
                    write(self.path, entries())
                    with h5py.File(self.path, 'a') as file:
                        file[name] = value
                    self.refused('/' + name, '[2, 15]')
            bad = good.copy()
            bad[1, 4] = np.nan
            write(self.path, entries())
            with h5py.File(self.path, 'a') as file:
                file[name] = bad
            self.refused('/%s[1, 4]' % name, 'NaN')

    def test_types(self):
        for dense in (np.full((C, N, N), b'x'), np.zeros((C, N, N), 'c8'),
                      np.zeros((C, N, N), [('a', 'f4'), ('b', 'f4')])):
            with self.subTest(kind=dense.dtype):
                write(self.path, dense)
                self.refused('/dense', 'numbers')

    def test_missing(self):
        for make, word in ((lambda file: file.pop('dense'), '/dense'),
                           (lambda file: file.move('dense', 'tree'), '/tree'),
                           (lambda file: (file.pop('dense'), file.create_group('tree')), '/tree/start'),
                           (lambda file: (file.pop('dense'), file.create_group('dense')), '/dense'),
                           (lambda file: (file.pop('dense'), file.__setitem__('dense', h5py.SoftLink('/gone'))), '/dense'),
                           (lambda file: file.create_group('black'), '/black')):
            write(self.path, entries())
            with h5py.File(self.path, 'a') as file:
                make(file)
            self.refused(word)

    def test_trees(self):
        good = dict(start=[0, 2, 3], node=[0, 1, 23], value=np.ones((C, 3)))
        for change, word in ((dict(start=[0, 3, 2]), '/tree/start[2]'), (dict(start=[0, 4, 3]), '/tree/start[1]'),
                             (dict(start=[1, 2, 3]), '/tree/start[0]'), (dict(start=[0]), '/tree/start'),
                             (dict(start=np.zeros(0, 'i8')), '/tree/start'), (dict(start=[0, 2, 2**62]), '/tree/start'),
                             (dict(start=[0, -1, 3]), '/tree/start[1]'), (dict(node=[0, 1, 24]), '/tree/node[2]'),
                             (dict(node=[0, -1, 2]), '/tree/node[1]'), (dict(node=[0, 2**40, 2]), '/tree/node[1]'),
                             (dict(node=[0, 1]), '/tree/value'), (dict(value=np.ones((C, 4))), '/tree/value'),
                             (dict(value=np.ones((1, 3))), '/tree/value'),
                             (dict(value=[[1, 1, 1], [1, np.nan, 1]]), '/tree/value[1, 1]'),
                             (dict(value=[[1, 1, -1], [1, 1, 1]]), '/tree/value[0, 2]')):
            with self.subTest(**{name: repr(value) for name, value in change.items()}):
                write(self.path, entries())
                with h5py.File(self.path, 'a') as file:
                    del file['dense']
                    for name, value in {**good, **change}.items():
                        file['tree/' + name] = value
                self.refused(word)

    def test_hollow(self):
        """Sizes that the file does not hold are refused before memory is taken for them."""
        write(self.path, entries())
        with h5py.File(self.path, 'a') as file:
            del file['dense']
            file.create_dataset('dense', (C, 2**28, N), 'f4', chunks=(1, 1024, N))
        self.refused('/dense', 'more values than the file holds')

    def test_no_transport(self):
        self.refused('No such file')
        os.mkdir(self.path)
        self.refused('not a file')
        os.rmdir(self.path)
        for content in (b'', b'hello', b'\x89HDF\r\n\x1a\n', os.urandom(4096)):
            with open(self.path, 'wb') as file:
                file.write(content)
            self.refused()
        os.remove(self.path)
        os.mkfifo(self.path)
        self.refused('not a file')


class Damaged(Case):
    def test_truncated(self):
        write(self.path, entries())
        with open(self.path, 'rb') as file:
            whole = file.read()
        for kept in np.linspace(0, len(whole) - 1, 40).astype(int):
            with open(self.path, 'wb') as file:
                file.write(whole[:kept])
            self.refused()


if __name__ == '__main__':
    SHOW = sys.argv.pop(1)
    unittest.main()
