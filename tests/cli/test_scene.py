"""scene explain: every shipped scene says of every effect whether it runs, why, and what it costs."""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])
NAMES = ("interreflection occlusion gloss subsurface defocus projector-black projector-response crosstalk ambient flicker "
         "noise camera-response quantisation saturation vignetting lens-blur latency rolling-shutter faults drift "
         "vibration change").split()
ALWAYS = {"projector-black", "projector-response", "ambient", "noise", "quantisation", "saturation", "latency"}
# What the scenes call for beside that; a scene that is not listed is only checked for form.
INDIRECT, HIDDEN, GLOSSY = {"interreflection"}, {"interreflection", "occlusion"}, {"interreflection", "gloss"}
CALLED_FOR = {"book": INDIRECT, "dihedral": INDIRECT, "corner": INDIRECT, "small": INDIRECT, "flat": set(), "box2": INDIRECT,
              "box3": INDIRECT, "box4": INDIRECT, "box5": INDIRECT, "box6": INDIRECT, "cornell": HIDDEN, "dome": HIDDEN,
              "gallery": HIDDEN, "own_camera": HIDDEN, "shadow": HIDDEN, "stage": HIDDEN,
              "glossy": GLOSSY, "highlight": HIDDEN | GLOSSY}


def coarser(folder):
    """The shipped scenes in folder, none with more than 16 x 16 cells: what a scene calls for is no matter of its grid."""
    scenes = pathlib.Path(shutil.copytree(SOURCE / "config" / "scenes", folder / "scenes"))
    for path in scenes.glob("*.cfg"):
        text = path.read_text()
        width, height = map(int, re.search(r"^grid = { width = (\d+); height = (\d+);", text, re.M).groups())
        while max(width, height) > 16:
            width, height = width // 2, height // 2
        path.write_text(re.sub(r"^grid = { width = \d+; height = \d+;", f"grid = {{ width = {width}; height = {height};", text,
                               flags=re.M))
    return scenes


def explain(path, *options):
    return subprocess.run([PROGRAM, "scene", "explain", str(path), *options], text=True, capture_output=True, timeout=300)


class Scene(unittest.TestCase):
    def check(self, path):
        answer = explain(path, "--json")
        self.assertEqual((answer.returncode, answer.stderr), (0, ""), path)
        effects = {effect["name"]: effect for effect in json.loads(answer.stdout)["effects"]}
        self.assertEqual(sorted(effects), sorted(NAMES))
        for effect in effects.values():
            self.assertEqual(set(effect), {"name", "on", "why", "prepare_ms", "frame_ms", "bytes"})
            self.assertGreater(len(effect["why"]), 15, effect)
            cost = (effect["prepare_ms"], effect["frame_ms"], effect["bytes"])
            self.assertTrue(all(figure >= 0 for figure in cost), effect)
            if not effect["on"]:
                self.assertEqual(cost, (0, 0, 0), effect)
        return effects

    def test_every_shipped_scene(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        folder = coarser(pathlib.Path(place.name))
        scenes = sorted(folder.glob("*.cfg"))
        self.assertTrue({path.stem for path in scenes} >= set(CALLED_FOR))
        for path in scenes:
            effects = self.check(path)
            on = {name for name, effect in effects.items() if effect["on"]}
            self.assertEqual(on, ALWAYS | CALLED_FOR.get(path.stem, on), path)
            if "interreflection" in on:
                self.assertGreater(effects["interreflection"]["frame_ms"], 0)
                self.assertGreater(effects["interreflection"]["bytes"], 0)
        self.assertIn("one flat", self.check(folder / "flat.cfg")["interreflection"]["why"])
        self.assertIn("1 of 1 pairs of surfaces face each other",
                      self.check(folder / "small.cfg")["interreflection"]["why"])

    def test_table_for_people(self):
        answer = explain(SOURCE / "config" / "scenes" / "small.cfg")
        self.assertEqual((answer.returncode, answer.stderr), (0, ""))
        lines = answer.stdout.splitlines()
        self.assertEqual(sorted(line.split()[0] for line in lines[1:]), sorted(NAMES))
        self.assertTrue(all(line.split()[1] in ("on", "off") for line in lines[1:]))

    def test_bad_input(self):
        answer = explain("/nowhere/scene.cfg")
        self.assertEqual((answer.returncode, answer.stdout), (2, ""))
        self.assertIn("/nowhere/scene.cfg", answer.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=0)
