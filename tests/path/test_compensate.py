"""compensate on transports that h5py wrote: its numbers are numpy's, and its drive is the bounded optimum."""
import json

import numpy as np
from scipy.optimize import lsq_linear

from support import (PathTest, answer_of, appearance, best_gain, decode_srgb, encode_srgb, main, read_png,
                     relative_error, room, run, write_png, write_transport)

WIDTH, HEIGHT = 10, 8


def smooth_picture(channels, seed=5):
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / HEIGHT
    waves = [0.5 + 0.3 * np.sin(3 * x + random.uniform(0, 6)) * np.cos(2 * y + random.uniform(0, 6))
             for _ in range(channels)]
    return np.stack(waves)


def checker(channels):
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.repeat(((x + y) % 2)[None].astype(float), channels, axis=0)


class Compensate(PathTest):
    def given(self, channels, radius, picture, seed=1):
        """Writes a room and a .npy target; the radiance wanted is with white = 1."""
        self.dense = room(WIDTH, HEIGHT, channels, radius, seed).astype("f4")
        self.black = np.random.default_rng(seed).uniform(0.001, 0.01, self.dense.shape[:2]).astype("f4")
        self.target = picture.astype("f4")
        self.transport, self.picture = self.folder / "T.h5", self.folder / "picture.npy"
        write_transport(self.transport, self.dense, WIDTH, HEIGHT, self.black)
        np.save(self.picture, self.target)
        self.wanted = self.target.reshape(channels, -1).astype(float)

    def compensate(self, out, *options, white=1.0):
        return answer_of("compensate", self.transport, "--target", self.picture, "-o", out, "--white", white, *options)

    def optimum(self):
        """The bounded optimum by scipy, channel by channel."""
        square = 0.0
        for c in range(len(self.dense)):
            rest = self.wanted[c] - self.black[c]
            found = lsq_linear(self.dense[c].astype(float), rest, (0, 1), method="bvls", tol=1e-12)
            square += 2 * found.cost
        return np.sqrt(square) / np.linalg.norm(self.wanted)

    def test_npy_drive_has_the_error_that_is_reported(self):
        for channels in (1, 3):
            self.given(channels, 0.5, smooth_picture(channels))
            answer = self.compensate(self.folder / "drive.npy", "--predict", self.folder / "seen.npy")
            drive = np.load(self.folder / "drive.npy")
            self.assertEqual((drive.dtype, drive.shape), (np.float32, (channels, HEIGHT, WIDTH)))
            self.assertTrue(drive.min() >= 0 and drive.max() <= 1)
            seen = appearance(self.dense, self.black, drive)
            self.assertAlmostEqual(relative_error(seen, self.wanted), answer["error_after"], delta=1e-4)
            np.testing.assert_allclose(np.load(self.folder / "seen.npy").reshape(channels, -1), seen, atol=1e-5)
            plain = appearance(self.dense, self.black, self.target)
            before = relative_error(best_gain(plain, self.wanted) * plain, self.wanted)
            self.assertAlmostEqual(before, answer["error_before"], delta=1e-4)
            self.assertEqual(answer["grid"], {"width": WIDTH, "height": HEIGHT, "channels": channels})
            self.assertAlmostEqual(answer["white"][0], 1.0)

    def test_a_dim_picture_is_bounded_as_a_bright_one(self):
        self.given(1, 0.9, smooth_picture(1))
        self.dense[0, 11] = self.dense[0, 40] = 0  # cells that show nothing, whose light the others still get
        self.black[:] = 0
        write_transport(self.transport, self.dense, WIDTH, HEIGHT, self.black)
        errors = []
        for white in (1e-1, 1e-12):
            answer = self.compensate(self.folder / "drive.npy", white=white)
            self.assertEqual(answer["method"], "bounded")
            errors.append(answer["error_after"])
        self.assertAlmostEqual(errors[0], errors[1], delta=1e-3 * errors[0])

    def test_png_drive_holds_panel_values(self):
        self.given(3, 0.5, smooth_picture(3))
        exact = self.compensate(self.folder / "drive.npy")
        answer = self.compensate(self.folder / "drive.png", "--predict", self.folder / "seen.png")
        codes = read_png(self.folder / "drive.png")
        linear = np.load(self.folder / "drive.npy")
        np.testing.assert_allclose(codes, encode_srgb(linear), atol=0.5 / 255 + 1e-6)
        seen = appearance(self.dense, self.black, decode_srgb(codes))
        self.assertAlmostEqual(relative_error(seen, self.wanted), answer["error_after"], delta=1e-4)
        self.assertTrue(exact["error_after"] < answer["error_after"] < 0.01)
        shown = read_png(self.folder / "seen.png")
        np.testing.assert_allclose(decode_srgb(shown).reshape(3, -1), np.clip(seen, 0, 1), atol=0.02)

    def test_response_of_the_transport_file_shapes_a_png_drive(self):
        import h5py
        self.given(1, 0.3, smooth_picture(1))
        with h5py.File(self.transport, "a") as file:
            file.attrs["response"] = "gamma 1.8"
        self.compensate(self.folder / "drive.npy")
        self.compensate(self.folder / "drive.png")
        linear = np.load(self.folder / "drive.npy")
        np.testing.assert_allclose(read_png(self.folder / "drive.png"), linear ** (1 / 1.8), atol=0.5 / 255 + 1e-6)
        seen = answer_of("relight", self.transport, "--light", self.folder / "drive.png", "-o", self.folder / "y.npy")
        self.assertEqual(seen["dual"], False)
        np.testing.assert_allclose(np.load(self.folder / "y.npy").reshape(1, -1),
                                   appearance(self.dense, self.black, linear), rtol=0.02)

    def test_reaches_the_bounded_optimum_where_clamping_does_not(self):
        for seed in (1, 2):
            self.given(1, 0.9, checker(1), seed)
            optimum = self.optimum()
            answer = self.compensate(self.folder / "drive.npy")
            seen = appearance(self.dense, self.black, np.load(self.folder / "drive.npy"))
            self.assertLessEqual(relative_error(seen, self.wanted), 1.02 * optimum)
            self.assertAlmostEqual(answer["error_limit"], optimum, delta=0.02 * optimum)
            free = np.linalg.solve(self.dense[0].astype(float), (self.wanted - self.black)[0])
            clamped = relative_error(appearance(self.dense, self.black, np.clip(free, 0, 1)), self.wanted)
            self.assertGreater(clamped, 1.3 * optimum)

    def test_every_method_reports_its_own_error(self):
        self.given(1, 0.25, smooth_picture(1))
        for method in ("jacobi", "pcg", "gmres", "bounded"):
            answer = self.compensate(self.folder / "drive.npy", "--method", method, "--tolerance", "1e-6")
            seen = appearance(self.dense, self.black, np.load(self.folder / "drive.npy"))
            self.assertEqual(answer["method"], method)
            self.assertTrue(answer["reason"])
            self.assertTrue(answer["converged"])
            self.assertAlmostEqual(relative_error(seen, self.wanted), answer["error_after"], delta=1e-4)

    def test_white_is_the_median_of_the_direct_light(self):
        self.given(3, 0.2, smooth_picture(3))
        answer = self.compensate(self.folder / "drive.npy", white="auto")
        medians = [np.median(np.diag(d)) for d in self.dense]
        np.testing.assert_allclose(answer["white"], medians, rtol=0.02)

    def test_resamples_a_picture_of_another_size(self):
        self.given(3, 0.3, smooth_picture(3))
        codes = np.random.default_rng(3).integers(0, 256, (3, 4 * HEIGHT, 4 * WIDTH)) / 255
        write_png(self.folder / "large.png", codes)
        blocks = decode_srgb(codes).reshape(3, HEIGHT, 4, WIDTH, 4).mean((2, 4))
        self.picture = self.folder / "large.png"
        from_png = self.compensate(self.folder / "a.npy")
        self.picture = self.folder / "blocks.npy"
        np.save(self.picture, blocks.astype("f4"))
        from_npy = self.compensate(self.folder / "b.npy")
        np.testing.assert_allclose(np.load(self.folder / "a.npy"), np.load(self.folder / "b.npy"), atol=2e-3)
        self.assertAlmostEqual(from_png["error_before"], from_npy["error_before"], delta=1e-4)

    def test_says_it_in_words_in_json_or_not_at_all(self):
        self.given(1, 0.3, smooth_picture(1))
        words = ("compensate", self.transport, "--target", self.picture, "-o", self.folder / "d.npy")
        quiet, plain, both = run(*words, "-q"), run(*words), run(*words, "--json", "-q")
        self.assertEqual((quiet.returncode, quiet.stdout, quiet.stderr), (0, "", ""))
        self.assertEqual((plain.returncode, plain.stderr), (0, ""))
        self.assertIn("%", plain.stdout)
        answer = json.loads(both.stdout)
        for key in ("error_before error_after error_limit clipped_fraction method reason iterations solve_ms residual "
                    "white converged grid").split():
            self.assertIn(key, answer)
        self.assertEqual(both.stderr, "")


class Optical(PathTest):
    """compensate through a rig, whose room is a transport that h5py wrote."""

    def setUp(self):
        super().setUp()
        self.dense = room(WIDTH, HEIGHT, 3, 0.5, 1).astype("f4")
        write_transport(self.folder / "T.h5", self.dense, WIDTH, HEIGHT)
        self.scene, self.picture = self.folder / "room.cfg", self.folder / "picture.npy"
        self.scene.write_text('transport_file = "T.h5";\n')
        self.words = ("--target", self.picture, "-o", self.folder / "drive.npy")

    def test_few_photographs_make_a_picture_that_can_appear(self):
        driven = 0.3 + 0.5 * smooth_picture(3)
        target = appearance(self.dense, np.zeros((3, 1)), driven)
        np.save(self.picture, target.reshape(3, HEIGHT, WIDTH).astype("f4"))
        answer = answer_of("compensate", "--scene", self.scene, *self.words, "--white", 1)
        drive = np.load(self.folder / "drive.npy")
        self.assertTrue(drive.min() >= 0 and drive.max() <= 1)
        seen = appearance(self.dense, 0.002, drive)
        self.assertLess(relative_error(seen, target), 0.01)
        self.assertLess(abs(answer["error_after"] - relative_error(seen, target)), 0.005)
        self.assertEqual(answer["method"], "optical")
        self.assertLessEqual(answer["photographs"], 20)
        self.assertEqual(answer["photographs"], answer["iterations"] + 3)

    def test_refuses_what_needs_a_transport(self):
        np.save(self.picture, smooth_picture(3).astype("f4"))
        for more, word in ((("--method", "pcg"), "--method"), (("--predict", self.folder / "s.png"), "--predict"),
                           (("--white", "feasible"), "feasible"), (("--photographs", 3), "photographs"),
                           (("--config", self.scene), "one of")):
            done = run("compensate", "--scene", self.scene, *self.words, *more)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(word, done.stderr)
        done = run("compensate", *self.words)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--scene", done.stderr)
        self.assertFalse((self.folder / "drive.npy").exists())


if __name__ == "__main__":
    main()
