"""bounces, relight --dual, separate and repaint: their files and figures against numpy's."""
import json

import numpy as np

from support import (SOURCE, PathTest, answer_of, appearance, decode_srgb, main, read_png, relative_error, room, run,
                     write_png, write_transport)

WIDTH, HEIGHT, CELLS = 10, 8, 80
WALLS = """
grid = {{ width = 24; height = 18; channels = 1; }};
projector = {{ position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.65, 0.85]; intensity = 40.0; }};
materials = ( {{ name = "left"; albedo = {0}; }}, {{ name = "right"; albedo = {1}; }} );
surfaces = (
  {{ corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "left"; }},
  {{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "right"; }} );
"""


class Analysis(PathTest):
    def given(self, channels, radius=0.5):
        self.dense = room(WIDTH, HEIGHT, channels, radius).astype("f4")
        self.black = np.random.default_rng(1).uniform(0.001, 0.01, self.dense.shape[:2]).astype("f4")
        self.transport, self.drive = self.folder / "T.h5", self.folder / "drive.npy"
        write_transport(self.transport, self.dense, WIDTH, HEIGHT, self.black)
        self.x = np.random.default_rng(2).uniform(0, 1, (channels, HEIGHT, WIDTH)).astype("f4")
        np.save(self.drive, self.x)

    def read_exr(self, path, width=WIDTH, height=HEIGHT, channels=1):
        """The numbers of a .exr, carried over by the unit transport."""
        unit = self.folder / f"unit-{width}-{height}-{channels}.h5"
        write_transport(unit, np.stack([np.eye(width * height)] * channels), width, height)
        answer_of("relight", unit, "--light", path, "-o", self.folder / "numbers.npy", "--dual")
        return np.load(self.folder / "numbers.npy").astype(float)

    def expected(self, exact, count):
        """Direct light and bounces [k, channels, cells] from the inverse of T."""
        terms = []
        for dense, x in zip(self.dense.astype(float), self.x.reshape(len(self.x), -1).astype(float)):
            inverse = np.linalg.inv(dense)
            first = 1 / np.diag(inverse) if exact else np.diag(dense)
            a = np.eye(CELLS) - first[:, None] * inverse
            b = [first * x]
            for _ in range(count):
                b.append(a @ b[-1])
            terms.append(b)
        return np.array(terms).transpose(1, 0, 2)

    def spread(self):
        """The contrast that a checkerboard loses in S beside its cell."""
        y, x = np.divmod(np.arange(CELLS), WIDTH)
        sign = (-1.0) ** (x + y)
        lost = [np.sort(1 - sign * (dense @ (sign / np.diag(dense))))[CELLS // 2] for dense in self.dense.astype(float)]
        return max(lost, key=abs)

    def forward(self, *options):
        """What relight --forward writes, [channels, cells], and what it tells."""
        out = self.folder / "forward.npy"
        answer = answer_of("relight", self.transport, "--light", self.drive, "-o", out, *options)
        return np.load(out).reshape(len(self.dense), -1).astype(float), answer["forward"]

    def test_forward_light_is_built_of_bounces(self):
        for channels, exact in ((1, False), (3, True)):
            self.given(channels)
            words = ["--exact-first-bounce"] if exact else []
            whole = appearance(self.dense, 0, self.x)
            for count in (0, 1, 5):
                seen, told = self.forward("--forward", "series", "-n", count, *words)
                wanted = self.expected(exact, count).sum(axis=0)
                np.testing.assert_allclose(seen, self.black + wanted, atol=1e-5)
                self.assertEqual(told["bounces"], count)
                self.assertAlmostEqual(told["difference"], relative_error(wanted, whole), delta=1e-6)
                last = self.expected(exact, count)[-1]
                direct = self.expected(exact, 0)[0]
                self.assertAlmostEqual(told["last"], np.linalg.norm(last) / np.linalg.norm(direct), delta=1e-6)
                self.assertAlmostEqual(told["bound"], told["norm"] ** (count + 1) / (1 - told["norm"]), delta=1e-9)
            seen, told = self.forward("--forward", "iteration", "--tolerance", 1e-7, *words)
            np.testing.assert_allclose(seen, self.black + whole, rtol=1e-5)
            self.assertLess(told["difference"], 1e-5)
            self.assertLessEqual(told["last"], 1e-7)

    def test_forward_paths_know_how_far_off_they_are(self):
        self.given(3)
        whole = appearance(self.dense, 0, self.x)
        for samples in (16, 256):
            ratios = []
            for seed in range(4):
                seen, told = self.forward("--forward", "montecarlo", "--samples", samples, "--seed", seed)
                off = relative_error(seen - self.black, whole)
                self.assertAlmostEqual(told["difference"], off, delta=1e-5)
                ratios.append(off / told["standard_error"])
            self.assertAlmostEqual(np.mean(ratios), 1, delta=0.15)
        self.assertGreater(np.linalg.norm(self.forward("--forward", "montecarlo", "--seed", 1)[0] - seen), 0)

    def test_paths_in_a_room_that_one_channel_does_not_light(self):
        self.given(3)
        self.dense[1] = 0
        write_transport(self.transport, self.dense, WIDTH, HEIGHT, self.black)
        done = run("relight", self.transport, "--light", self.drive, "-o", self.folder / "seen.npy", "--forward",
                   "montecarlo", "--samples", 1000)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertNotIn("illegal", done.stdout)
        seen = np.load(self.folder / "seen.npy").reshape(3, -1)
        whole = appearance(self.dense, self.black, self.x)
        np.testing.assert_array_equal(seen[1], self.black[1])
        self.assertLess(relative_error(seen, whole), 0.05)

    def test_forward_refuses(self):
        self.given(1)
        words = ("relight", self.transport, "--light", self.drive, "-o", self.folder / "y.npy")
        self.refused(*words, "--forward", "magic", names="series, iteration or montecarlo")
        self.refused(*words, "--forward", "series", "--dual", names="--dual")
        self.refused(*words, "--forward", "series", "-n", -1, names="bounces")
        self.refused(*words, "--forward", "montecarlo", "--samples", 0, names="samples")
        swapped = np.full((1, CELLS, CELLS), 2.0) - np.eye(CELLS)  # A has eigenvalues of 2, though no row of T shows it
        write_transport(self.transport, swapped, WIDTH, HEIGHT)
        self.refused(*words, "--forward", "series", names="||A|| is not below 1")
        self.refused(*words, "--forward", "iteration", names="||A|| is not below 1")
        self.refused(*words, "--forward", "montecarlo", names="||A|| < 1")

    def test_bounces_are_those_of_the_inverse(self):
        for channels, exact in ((1, False), (3, True)):
            self.given(channels)
            out = self.folder / f"bounces-{channels}"
            words = ("bounces", self.transport, "--drive", self.drive, "-n", 5, "-o", out)
            answer = answer_of(*words, *(["--exact-first-bounce"] if exact else []))
            wanted = self.expected(exact, 5)
            self.assertEqual([t["name"] for t in answer["terms"]], ["direct"] + [f"bounce-{k}" for k in range(1, 6)])
            whole = appearance(self.dense, 0, self.x).sum()
            total = self.read_exr(out / "rest.exr", channels=channels)
            for k, term in enumerate(answer["terms"]):
                seen = self.read_exr(out / f"{term['name']}.exr", channels=channels)
                np.testing.assert_allclose(seen.reshape(channels, -1), wanted[k], atol=2e-7)
                self.assertAlmostEqual(term["energy"], wanted[k].sum(), delta=1e-5 * whole)
                self.assertAlmostEqual(term["share"], wanted[k].sum() / whole, delta=1e-6)
                self.assertLess(term["residual"], 1e-8)
                shown = decode_srgb(read_png(out / f"{term['name']}.png"))
                scaled = wanted[k].reshape(channels, HEIGHT, WIDTH) * term["gain"]
                scaled /= np.array(answer["white"])[:, None, None]
                np.testing.assert_allclose(shown, np.clip(scaled, 0, 1), atol=0.01)
                total += seen
            picture = self.read_exr(out / "picture.exr", channels=channels)
            np.testing.assert_allclose(picture.reshape(channels, -1), appearance(self.dense, 0, self.x), rtol=1e-6)
            np.testing.assert_allclose(total, picture, rtol=2e-6)
            self.assertLess(answer["sum_error"], 1e-6)
            self.assertAlmostEqual(answer["spread"], self.spread(), delta=1e-5)
            self.assertEqual(answer["inexact"], self.spread() > 0.01)
            stored = json.loads((out / "summary.json").read_text())
            self.assertEqual(stored["terms"], answer["terms"])

    def test_bounces_of_a_photograph_are_those_of_its_drive(self):
        self.given(1)
        photo = self.folder / "photo.npy"
        np.save(photo, appearance(self.dense, self.black, self.x).reshape(1, HEIGHT, WIDTH).astype("f4"))
        out = self.folder / "out"
        answer = answer_of("bounces", self.transport, "--photo", photo, "-o", out, "-n", 2)
        wanted = self.expected(False, 2)
        for k, term in enumerate(answer["terms"]):
            seen = self.read_exr(out / f"{term['name']}.exr").reshape(1, -1)
            np.testing.assert_allclose(seen, wanted[k], atol=1e-5)

    def test_loose_solves_show_what_eq_51_loses(self):
        self.given(1, 0.45)
        words = ("bounces", self.transport, "--drive", self.drive, "-n", 12, "-o", self.folder / "out")
        tight, loose = answer_of(*words), answer_of(*words, "--tolerance", "1e-3", "--method", "jacobi")
        wanted = self.expected(False, 12)
        self.assertEqual((tight["method"], loose["method"]), ("pcg", "jacobi"))
        self.assertLess(tight["terms"][8]["eq51_difference"], 1e-4)
        self.assertGreater(max(t["eq51_difference"] for t in loose["terms"][8:]), 0.3)
        self.assertAlmostEqual(loose["terms"][8]["energy"], wanted[8].sum(), delta=0.02 * wanted[8].sum())

    def test_dual_is_the_transposed_product(self):
        self.given(3)
        random = np.random.default_rng(7).uniform(0.5, 1.5, self.dense.shape)
        self.dense = (self.dense * random).astype("f4")
        write_transport(self.transport, self.dense, WIDTH, HEIGHT, self.black)
        out = self.folder / "dual.npy"
        answer = answer_of("relight", self.transport, "--light", self.drive, "-o", out, "--dual")
        wanted = np.einsum("cij,ci->cj", self.dense.astype(float), self.x.reshape(3, -1).astype(float))
        np.testing.assert_allclose(np.load(out).reshape(3, -1), wanted, rtol=1e-5)
        self.assertTrue(answer["dual"])

    def test_repaint_finds_the_factor_and_predicts(self):
        self.given(1)
        dense, x = self.dense[0].astype(float), self.x.reshape(-1).astype(float)
        inverse = np.linalg.inv(dense)
        first = 1 / np.diag(inverse)
        a = np.eye(CELLS) - first[:, None] * inverse
        ratio = np.where(np.arange(CELLS) % WIDTH < 4, 0.5, 1.2)
        new = np.linalg.solve(np.eye(CELLS) - ratio[:, None] * a, np.diag(ratio * first))
        photo, out, seen = (self.folder / n for n in ("photo.npy", "ratio.npy", "seen.npy"))
        np.save(photo, (new @ x + self.black[0]).reshape(1, HEIGHT, WIDTH).astype("f4"))
        light = self.folder / "light.npy"
        other = np.random.default_rng(9).uniform(0, 1, (1, HEIGHT, WIDTH)).astype("f4")
        np.save(light, other)
        answer = answer_of("repaint", self.transport, "--photo", photo, "--drive", self.drive, "-o", out,
                           "--exact-first-bounce", "--predict", seen, "--light", light)
        np.testing.assert_allclose(np.load(out).reshape(-1), ratio, rtol=1e-4)
        np.testing.assert_allclose(np.load(seen).reshape(-1), new @ other.reshape(-1) + self.black[0], rtol=1e-4)
        self.assertEqual(answer["undetermined"], 0)
        np.testing.assert_allclose(answer["ranges"], [[0.5, 1.2]], rtol=1e-4)
        run("repaint", self.transport, "--photo", photo, "--drive", self.drive, "-o", self.folder / "map.png", "-q")
        shown = decode_srgb(read_png(self.folder / "map.png")).reshape(-1)
        np.testing.assert_allclose(shown, ratio / 2, atol=0.03)

    def test_repainted_scene_by_photographs(self):
        """Two simulated rooms: T measured in the first, one noisy photograph and one black in the second."""
        for name, albedos in (("old", (0.7, 0.7)), ("new", (0.35, 0.77))):
            (self.folder / f"{name}.cfg").write_text(WALLS.format(*albedos))
        drive = self.folder / "half.npy"
        np.save(drive, np.full((1, 18, 24), 0.8, "f4"))
        np.save(self.folder / "none.npy", np.zeros((1, 18, 24), "f4"))
        answer_of("acquire", "--scene", self.folder / "old.cfg", "-o", self.folder / "T.h5", "--scheme", "brute")
        for name, shown in (("photo", drive), ("black", self.folder / "none.npy")):
            answer_of("simulate", self.folder / "new.cfg", "--drive", shown, "-o", self.folder / f"{name}.npy")
        answer = answer_of("repaint", self.folder / "T.h5", "--photo", self.folder / "photo.npy", "--black",
                           self.folder / "black.npy", "--drive", drive, "-o", self.folder / "ratio.npy")
        ratio, lit = np.load(self.folder / "ratio.npy")[0], np.load(self.folder / "photo.npy")[0] > 0.05
        self.assertEqual(answer["undetermined"], int((ratio == 1).sum()))
        self.assertAlmostEqual(float(np.median(ratio[:, :12][lit[:, :12]])), 0.5, delta=0.005)
        self.assertAlmostEqual(float(np.median(ratio[:, 12:][lit[:, 12:]])), 1.1, delta=0.01)

    def test_spread_of_a_measured_room_is_flagged(self):
        """Case 23: subsurface and defocus in the scene, T measured through noisy frames."""
        wide = 0.159  # a Gaussian of one cell at its middle: what of the spread light stays in its cell
        cases = (("", None, 0, 2e-3), ("subsurface = { share = 0.3; radius = 1.0; };", None, 0.3, 0.01),
                 ("subsurface = { share = 0.1; radius = 1.0; };", None, 0.1, 0.005), ("", "defocus = 0.4; ", 0, None))
        for more, lens, share, within in cases:
            text = WALLS.format(0.7, 0.7).replace("intensity", (lens or "") + "intensity") + more
            (self.folder / "walls.cfg").write_text(text)
            answer_of("acquire", "--scene", self.folder / "walls.cfg", "-o", self.folder / "T.h5", "--scheme", "brute")
            np.save(self.folder / "full.npy", np.ones((1, 18, 24), "f4"))
            answer = answer_of("bounces", self.folder / "T.h5", "--drive", self.folder / "full.npy", "-n", 1, "-o",
                               self.folder / "out")
            if within is None:
                self.assertGreater(answer["spread"], 0.2)
            else:  # of a checkerboard 1 - share stays, of a cell alone 1 - share + share * wide
                self.assertAlmostEqual(answer["spread"], 1 - (1 - share) / (1 - share + share * wide), delta=within)
            self.assertEqual((answer["inexact"], bool(answer["why"])), (bool(more or lens),) * 2)

    def test_separate_tells_direct_from_global(self):
        scene = self.folder / "walls.cfg"
        scene.write_text(WALLS.format(0.7, 0.7))
        full = self.folder / "full.npy"
        np.save(full, np.ones((1, 18, 24), "f4"))
        for name in ("full", "none"):
            np.save(self.folder / f"{name}.npy", np.full((1, 18, 24), float(name == "full"), "f4"))
            answer_of("simulate", scene, "--drive", self.folder / f"{name}.npy", "-o", self.folder / f"y-{name}.npy",
                      "--exact")
        total = np.load(self.folder / "y-full.npy") - np.load(self.folder / "y-none.npy")
        out = self.folder / "out"
        answer = answer_of("separate", "--scene", scene, "-o", out, "--repeats", 4)
        direct = self.read_exr(out / "direct.exr", 24, 18)
        far = self.read_exr(out / "global.exr", 24, 18)
        self.assertLess(np.linalg.norm(direct + far - total) / np.linalg.norm(total), 0.01)
        self.assertEqual((answer["patterns"], answer["square"]), (4 * 20, 2))
        self.assertAlmostEqual(answer["global_share"], far.sum() / (direct + far).sum(), delta=1e-4)
        lower = answer_of("separate", "--scene", scene, "-o", out, "--drive-level", 0.5, "--square", 2)
        again = self.read_exr(out / "direct.exr", 24, 18)
        self.assertLess(np.linalg.norm(again - direct) / np.linalg.norm(direct), 0.03)
        self.assertEqual(lower["patterns"], 10)

    def test_bad_input_leaves_nothing(self):
        self.given(1)
        good = ("--drive", self.drive, "-o", self.folder / "new")
        self.refused("bounces", self.transport, "-o", self.folder / "new", names="either --drive or --photo")
        self.refused("bounces", self.transport, *good, "--photo", self.drive, names="either")
        self.refused("bounces", self.transport, *good, "-n", 65, names="0 to 64")
        self.refused("bounces", self.transport, *good, "-n", 1.5, names="whole")
        self.refused("bounces", self.transport, *good, "--method", "bounded", names="0..1")
        self.refused("bounces", self.transport, "--drive", self.drive, "-o", self.drive, names="no folder")
        self.refused("bounces", self.folder / "none.h5", *good, names="none.h5")
        self.refused("separate", "-o", self.folder / "new", names="--scene")
        scene = SOURCE / "config" / "scenes" / "small.cfg"
        self.refused("separate", "--scene", scene, "-o", self.folder / "new", "--square", 17, names="1 to 16")
        self.refused("separate", "--scene", scene, "-o", self.folder / "no" / "such", names="such")
        self.refused("repaint", self.transport, "--drive", self.drive, "-o", self.folder / "r.npy", names="--photo")
        self.refused("repaint", self.transport, "--photo", self.drive, "--drive", self.drive, "-o",
                     self.folder / "r.npy", "--light", self.drive, names="--predict")
        self.assertFalse((self.folder / "new").exists())


if __name__ == "__main__":
    main()
