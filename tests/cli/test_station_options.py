"""acquire and demo with recordings and with cameras that have pixels of their own; drives of measured panels."""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np

PROGRAM = sys.argv[1]
ROOM = """
seed = 5;
grid = { width = 16; height = 12; channels = 3; rays = 4; };
projector = { position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.4, 0.3]; intensity = 40.0; };
camera = { %s };
materials = ( { name = "warm"; albedo = [0.7, 0.6, 0.5]; } );
surfaces = (
  { corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "warm"; },
  { corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "warm"; } );
"""
ALIGNED = "cell_pixels = 6;"
OWN = """pixels = [112, 84]; position = [0.26, -3.2, 0.1]; target = [0.0, 0.0, 0.0]; tangent = [0.46, 0.345];
  distortion = [-0.05, 0.01, 0.0, 0.0, 0.0];"""


def numbers(path):
    """Every data set of an HDF5 file."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


class Station(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = pathlib.Path(place.name)

    def path(self, name):
        return str(self.folder / name)

    def room(self, name, camera):
        (self.folder / name).write_text(ROOM % camera)
        return self.path(name)

    def run_it(self, *arguments, code=0):
        answer = subprocess.run([PROGRAM, *arguments], text=True, capture_output=True, timeout=110)
        self.assertEqual(answer.returncode, code, answer)
        return answer

    def test_a_recording_gives_the_same_transport(self):
        scene = self.room("room.cfg", "cell_pixels = 1;")
        again = ["acquire", "--scene", scene, "--scheme", "hadamard", "--replay", self.path("frames"), "-o"]
        self.run_it("acquire", "--scene", scene, "--scheme", "hadamard", "--record", self.path("frames"), "-o",
                    self.path("first.h5"))
        self.run_it(*again, self.path("second.h5"))
        first, second = numbers(self.path("first.h5")), numbers(self.path("second.h5"))
        self.assertEqual(first.keys(), second.keys())
        self.assertGreater(sum(value.size for value in first.values()), 3 * 192 * 192)
        for name in first:
            self.assertTrue(np.array_equal(first[name], second[name]), name)

        index = self.folder / "frames" / "index.txt"
        lines = index.read_text().splitlines(keepends=True)
        index.write_text("".join(lines[:-5]))
        self.assertIn("the recording ends after", self.run_it(*again, self.path("short.h5"), code=1).stderr)
        index.write_text("".join(lines))
        missing = self.folder / "frames" / lines[-20].split()[-1]
        missing.unlink()
        self.assertIn(missing.name, self.run_it(*again, self.path("short.h5"), code=2).stderr)
        self.assertFalse((self.folder / "short.h5").exists())

        answer = self.run_it(*again, self.path("x.h5"), "--record", self.path("more"), code=2)
        self.assertIn("exclude each other", answer.stderr)

    def test_a_recording_holds_the_calibration_too(self):
        scene = self.room("own.cfg", OWN)
        self.run_it("acquire", "--scene", scene, "--record", self.path("frames"), "-o", self.path("first.h5"))
        self.run_it("acquire", "--scene", scene, "--replay", self.path("frames"), "-o", self.path("second.h5"))
        first, second = numbers(self.path("first.h5")), numbers(self.path("second.h5"))
        for name in first:
            self.assertTrue(np.array_equal(first[name], second[name]), name)

    def test_own_pixels_compensate_as_well_as_aligned_ones(self):
        results = {}
        for name, camera in (("aligned", ALIGNED), ("own", OWN)):
            scene = self.room(name + ".cfg", camera)
            answer = self.run_it("demo", "--scene", scene, "-o", self.path(name), "--json")
            results[name] = json.loads(answer.stdout)
            print(name, {key: results[name][key] for key in ("error_before", "error_after", "error_exact_after")},
                  file=sys.stderr)
            self.assertEqual((self.folder / name / "calibration.h5").exists(), name == "own")
        self.assertLess(results["own"]["error_after"], results["aligned"]["error_after"] + 0.005)
        self.check_measured_panel(self.folder / "own")

    def check_measured_panel(self, made):
        transport, calibration = str(made / "transport.h5"), str(made / "calibration.h5")
        drive, linear, seen = self.path("drive.png"), self.path("drive.npy"), self.path("seen.npy")
        target = ("--target", str(made / "target.png"), "-o")
        self.assertIn("give --calibration", self.run_it("compensate", transport, *target, drive, code=2).stderr)
        self.run_it("compensate", transport, *target, linear)
        self.run_it("compensate", transport, *target, drive, "--calibration", calibration)
        self.assertIn("give --calibration", self.run_it("relight", transport, "-l", drive, "-o", seen, code=2).stderr)
        self.run_it("relight", transport, "-l", drive, "-o", seen, "--calibration", calibration)
        by_codes = np.load(seen)
        self.run_it("relight", transport, "-l", linear, "-o", seen)
        by_light = np.load(seen)
        # 8 bits of an sRGB-like panel: half a code is at most 0.5 % of full light, and averages out over neighbours.
        self.assertLess(np.linalg.norm(by_codes - by_light), 0.005 * np.linalg.norm(by_light))
        self.check_analysis(transport, calibration, drive, linear, seen)

    def check_analysis(self, transport, calibration, drive, linear, seen):
        """bounces and repaint read a measured panel's drive by its calibration, and not without."""
        energies, ratios = [], []
        for name, light in (("codes", drive), ("light", linear)):
            given = ("--calibration", calibration) if light == drive else ()
            bounces = ("bounces", transport, "--drive", light, "-n", "1", "-o", self.path("bounces-" + name), "--json")
            repaint = ("repaint", transport, "--drive", light, "--photo", seen, "-o", self.path(name + ".npy"))
            if given:
                self.assertIn("give --calibration", self.run_it(*bounces, code=2).stderr)
                self.assertIn("give --calibration", self.run_it(*repaint, code=2).stderr)
            told = json.loads(self.run_it(*bounces, *given).stdout)
            energies.append([term["energy"] for term in told["terms"]])
            self.run_it(*repaint, *given)
            ratios.append(np.load(self.path(name + ".npy")))
        self.assertLess(np.abs(np.subtract(*energies)).max(), 0.005 * max(energies[1]))
        self.assertLess(np.median(np.abs(ratios[0] - ratios[1])), 0.01)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=0)
