"""demo on a small room: every result is there, and numpy finds the numbers of the summary in the files."""
import json
import os
import pathlib
import re
import signal
import subprocess
import time

import h5py
import numpy as np

from support import (PROGRAM, PathTest, answer_of, appearance, best_gain, decode_srgb, main, read_png, relative_error,
                     run, write_png)

RESULTS = {"target.png", "uncompensated.png", "compensated.png", "pattern.png", "error-before.png", "error-after.png",
           "transport.h5", "summary.json", "report.html"}
WIDTH, HEIGHT = 16, 12
SCENE = """
grid = { width = %d; height = %d; channels = %d; };
projector = { position = [0.0, -3.2, 0.0]; target = [0.0, 0.0, 0.0]; tangent = [0.44, 0.33]; };
materials = ( { name = "white"; albedo = 0.7; } );
surfaces = (
  { corner = [0.0, 0.0, -1.2]; u = [0.0, 0.0, 2.4]; v = [-1.7, -1.7, 0.0]; material = "white"; },
  { corner = [0.0, 0.0, -1.2]; u = [1.7, -1.7, 0.0]; v = [0.0, 0.0, 2.4]; material = "white"; }
);
seed = %d;
"""


class Demo(PathTest):
    def scene(self, width=WIDTH, height=HEIGHT, channels=3, seed=1):
        path = self.folder / "room.cfg"
        path.write_text(SCENE % (width, height, channels, seed))
        return path

    def demo(self, *options, **scene):
        self.out = self.folder / "out"
        answer = answer_of("demo", "--scene", self.scene(**scene), "-o", self.out, *options)
        self.assertEqual({p.name for p in self.out.iterdir()}, RESULTS)
        self.assertEqual(json.loads((self.out / "summary.json").read_text()), answer)
        return answer

    def stored(self):
        with h5py.File(self.out / "transport.h5") as file:
            return file["dense"][:].astype(float), file["black"][:].astype(float)

    def test_leaves_everything_and_the_numbers_are_in_the_files(self):
        for seed, channels in ((1, 3), (2, 1)):
            answer = self.demo(seed=seed, channels=channels)
            dense, black = self.stored()
            white = np.array(answer["white"])[:, None]
            self.assertEqual(answer["grid"], {"width": WIDTH, "height": HEIGHT, "channels": channels})
            picture = decode_srgb(read_png(self.out / "target.png")).reshape(channels, -1)
            drive = decode_srgb(read_png(self.out / "pattern.png")).reshape(channels, -1)
            target = white * picture
            predicted = relative_error(appearance(dense, black, drive), target)
            self.assertAlmostEqual(predicted, answer["error_after"], delta=0.006)
            plain = appearance(dense, black, picture)
            before = relative_error(best_gain(plain, target) * plain, target)
            self.assertAlmostEqual(before, answer["error_before"], delta=0.006)
            photograph = decode_srgb(read_png(self.out / "compensated.png")).reshape(channels, -1)
            self.assertAlmostEqual(relative_error(photograph, picture), answer["error_after"], delta=0.01)
            photograph = decode_srgb(read_png(self.out / "uncompensated.png")).reshape(channels, -1)
            self.assertAlmostEqual(relative_error(photograph, picture), answer["error_before"], delta=0.02)

    def test_compensation_comes_near_the_limit(self):
        for seed in (1, 2, 3):
            answer = self.demo(seed=seed)
            self.assertLessEqual(answer["error_after"], max(1.25 * answer["error_limit"], 0.01))
            self.assertLessEqual(answer["error_exact_after"], max(1.25 * answer["error_limit"], 0.01))
            self.assertGreaterEqual(answer["error_before"], 3 * answer["error_after"])
            self.assertAlmostEqual(answer["error_exact_before"], answer["error_before"], delta=0.01)

    def test_error_maps_share_one_scale(self):
        self.demo()
        before, after = (read_png(self.out / f"error-{name}.png").sum(0) for name in ("before", "after"))
        self.assertGreater(before.mean(), 2 * after.mean())

    def test_summary_has_what_scripts_read(self):
        answer = self.demo()
        for key in ("grid patterns frames acquire_s method iterations solve_ms error_before error_after error_limit "
                    "clipped_fraction white reason scene target timings error_predicted error_exact_before "
                    "error_exact_after").split():
            self.assertIn(key, answer)
        self.assertGreater(answer["patterns"], 0)
        self.assertGreaterEqual(answer["frames"], answer["patterns"])
        self.assertTrue(all(seconds >= 0 for seconds in answer["timings"].values()))

    def test_report_holds_everything_itself(self):
        self.demo()
        page = (self.out / "report.html").read_text()
        self.assertEqual(len(re.findall(r'src="data:image/png;base64,', page)), 6)
        self.assertIsNone(re.search(r'(src|href)="(?!data:)', page))
        self.assertNotIn("<script", page)
        self.assertIn("<polyline", page)

    def test_takes_a_picture_and_a_scheme(self):
        target = self.folder / "target.png"
        codes = np.random.default_rng(1).uniform(0.2, 0.9, (3, HEIGHT, WIDTH))
        write_png(target, codes)
        answer = self.demo("--target", target, "--scheme", "brute")
        np.testing.assert_allclose(read_png(self.out / "target.png"), read_png(target), atol=1.01 / 255)
        self.assertEqual(answer["scheme"], "brute")
        self.assertEqual(answer["target"], str(target))

    def test_runs_again_into_the_same_folder_and_quietly(self):
        self.demo()
        done = run("demo", "--scene", self.scene(seed=5), "-o", str(self.out) + "/", "-q")
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))
        self.assertEqual({p.name for p in self.out.iterdir()}, RESULTS)


class Steps(PathTest):
    """The same path command by command."""

    scene = Demo.scene

    def test_acquire_inspect_compensate_simulate_relight(self):
        scene, transport = self.scene(), self.folder / "T.h5"
        measured = answer_of("acquire", "--scene", scene, "-o", transport)
        self.assertGreater(measured["patterns"], 0)
        seen = answer_of("inspect", transport)
        self.assertEqual(seen["grid"], measured["grid"])
        self.assertEqual(seen["rows"], WIDTH * HEIGHT)
        self.check_bounds(transport, seen)
        target = self.folder / "target.png"
        write_png(target, np.random.default_rng(1).uniform(0.3, 0.8, (3, HEIGHT, WIDTH)))
        made = answer_of("compensate", transport, "--target", target, "-o", self.folder / "drive.png")
        white = np.array(made["white"])[:, None]
        wanted = white * decode_srgb(read_png(target)).reshape(3, -1)
        for options in (), ("--exact",):
            answer_of("simulate", scene, "--drive", self.folder / "drive.png", "-o", self.folder / "y.npy", *options)
            photograph = np.load(self.folder / "y.npy").reshape(3, -1)
            self.assertAlmostEqual(relative_error(photograph, wanted), made["error_after"], delta=0.01)
        self.check_relight(transport)

    def check_bounds(self, transport, seen):
        with h5py.File(transport) as file:
            dense = file["dense"][:].astype(float)
        for entries, channel in zip(dense, seen["channels"]):
            reflected = np.clip(entries / np.diag(entries), 0, None) - np.eye(len(entries))
            radius = np.abs(np.linalg.eigvals(reflected)).max()
            self.assertLessEqual(channel["radius_low"], radius * 1.001)
            self.assertGreaterEqual(channel["radius_high"], radius * 0.999)
            self.assertAlmostEqual(channel["white"], np.median(np.diag(entries)), delta=0.01 * channel["white"])

    def check_relight(self, transport):
        with h5py.File(transport) as file:
            dense, black = file["dense"][:].astype(float), file["black"][:].astype(float)
        light = np.random.default_rng(4).uniform(0, 1, (3, HEIGHT, WIDTH)).astype("f4")
        np.save(self.folder / "light.npy", light)
        wanted = {(): appearance(dense, black, light),
                  ("--dual",): np.einsum("cij,ci->cj", dense, light.reshape(3, -1).astype(float))}
        for options, numbers in wanted.items():
            answer_of("relight", transport, "--light", self.folder / "light.npy", "-o", self.folder / "y.npy", *options)
            np.testing.assert_allclose(np.load(self.folder / "y.npy").reshape(3, -1), numbers, rtol=1e-5, atol=1e-7)
            answer_of("relight", transport, "--light", self.folder / "light.npy", "-o", self.folder / "y.png", "--scale",
                      2 * numbers.max(), *options)
            np.testing.assert_allclose(decode_srgb(read_png(self.folder / "y.png")).reshape(3, -1),
                                       numbers / (2 * numbers.max()), atol=5e-3)

    def test_exact_simulation_has_no_noise_and_the_photograph_has_its_own(self):
        scene, drive = self.scene(), self.folder / "drive.npy"
        np.save(drive, np.full((3, HEIGHT, WIDTH), 0.5, "f4"))

        def seen(*options):
            answer_of("simulate", scene, "--drive", drive, "-o", self.folder / "y.npy", *options)
            return np.load(self.folder / "y.npy")

        exact, photograph = seen("--exact"), seen()
        np.testing.assert_array_equal(exact, seen("--exact"))
        off = relative_error(photograph, exact)
        self.assertTrue(1e-6 < off < 0.03, off)

    def wait_until_it_listens(self, process):
        """Until SIGINT has a handler (SigCgt in proc(5))."""
        status = pathlib.Path(f"/proc/{process.pid}/status")
        while int(re.search(r"SigCgt:\s*(\w+)", status.read_text())[1], 16) >> (signal.SIGINT - 1) & 1 == 0:
            self.assertIsNone(process.poll())
            time.sleep(0.02)

    def test_interrupt_ends_an_acquisition_with_nothing_written(self):
        scene = self.scene(48, 36, 3)
        for name, output, number in (("acquire", "T.h5", signal.SIGINT), ("acquire", "T.h5", signal.SIGTERM),
                                     ("demo", "out", signal.SIGINT)):
            process = subprocess.Popen([PROGRAM, name, "--scene", scene, "--scheme", "brute", "-o",
                                        self.folder / output], text=True, stderr=subprocess.PIPE)
            self.wait_until_it_listens(process)
            process.send_signal(number)
            line = process.communicate(timeout=60)[1]
            self.assertEqual(process.returncode, 1, line)
            self.assertEqual(line, f"counterlight {name}: interrupted; nothing was written\n")
            self.assertEqual([p.name for p in self.folder.iterdir()], ["room.cfg"])

    def test_progress_shows_on_a_terminal_only(self):
        scene = self.scene()
        words = [PROGRAM, "acquire", "--scene", scene, "-o", self.folder / "T.h5"]
        for extra, expected in ((), True), (("-q",), False):
            try:
                master, slave = os.openpty()
            except OSError as error:
                self.skipTest(f"no terminal to be had: {error}")
            done = subprocess.run([*words, *extra], stdout=subprocess.PIPE, stderr=slave, timeout=60)
            os.close(slave)
            drawn = b""
            while True:
                try:
                    part = os.read(master, 65536)
                except OSError:
                    break
                if not part:
                    break
                drawn += part
            os.close(master)
            self.assertEqual(done.returncode, 0)
            self.assertEqual(b"measuring [" in drawn, expected)


if __name__ == "__main__":
    main()
