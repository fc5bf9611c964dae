"""calibrate on simulated devices, against what their scene file says; then the same from the frames it recorded."""
import html.parser
import json
import re

import h5py
import numpy as np

from support import PathTest, answer_of, decode_srgb, main, run, write_png

PANEL, CAMERA = (32, 24), (96, 72)
LATENCY, BLACK = 0.037, 0.002
SCENE = f"""
seed = 4;
grid = {{ width = {PANEL[0]}; height = {PANEL[1]}; channels = 3; }};
projector = {{ position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.4, 0.3]; intensity = 40.0;
  response = "srgb"; refresh_hz = 120; latency_ms = {1e3 * LATENCY}; jitter_ms = 2; black = {BLACK}; }};
camera = {{ pixels = [{CAMERA[0]}, {CAMERA[1]}]; fps = 60; position = [0.75, -3.1, 0.35]; target = [-0.08, 0.0, -0.05];
  tangent = [0.46, 0.345]; distortion = [-0.12, 0.02, 0.0005, -0.0004, 0.0]; response = "gamma 1.8"; }};
ambient = [0.004, 0.003, 0.002]; flicker = {{ mains_hz = 50; depth = 0.3; }};
materials = ( {{ name = "m"; albedo = [0.7, 0.6, 0.5]; }} );
surfaces = (
  {{ corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "m"; }},
  {{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "m"; }} );
"""
HOW = ("--levels", 17, "--frames", 3, "--watch", 1)
VOID = {"meta", "img", "br", "line", "rect", "polyline", "link"}


class Page(html.parser.HTMLParser):
    """Checks that every tag is closed in its turn, and collects the words."""

    def __init__(self, text):
        super().__init__()
        self.open, self.words, self.wrong = [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        pass

    def handle_endtag(self, tag):
        if tag not in VOID and (not self.open or self.open.pop() != tag):
            self.wrong.append((tag, self.getpos()))

    def handle_data(self, data):
        self.words.append(data)


def contents(path):
    """Everything in a calibration file but when and from what it was made."""
    with h5py.File(path) as file:
        found = {f"@{k}": v for k, v in file.attrs.items() if k not in ("source", "calibrated")}
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


class CalibrateLive(PathTest):
    def setUp(self):
        super().setUp()
        self.scene = self.folder / "scene.cfg"
        self.scene.write_text(SCENE)

    def test_devices_then_their_recording(self):
        out, again, frames = self.folder / "out", self.folder / "again", self.folder / "frames"
        answer = answer_of("calibrate", "--scene", self.scene, "-o", out, "--record", frames, *HOW)
        self.assertEqual({p.name for p in out.iterdir()},
                         {"calibration.h5", "map.npy", "coverage.png", "summary.json", "report.html"})
        self.assertEqual(json.loads((out / "summary.json").read_text()), answer)
        self.check_photometry(answer)
        self.check_exposures(answer)
        self.check_map(out)
        self.check_black(answer)
        self.check_file(out, answer)
        self.check_page(out, answer)
        replayed = answer_of("calibrate", "--replay", frames, "-o", again, *HOW)
        first, second = contents(out / "calibration.h5"), contents(again / "calibration.h5")
        self.assertEqual(first.keys(), second.keys())
        for name, value in first.items():
            np.testing.assert_array_equal(value, second[name], name)
        for document in (answer, replayed):
            for key in ("output", "source", "calibrated", "seconds"):
                del document[key]
        self.assertEqual(answer, replayed)
        self.check_lens(frames, again, answer)
        self.refused("calibrate", "--scene", self.scene, "-o", self.folder / "new", "--record", frames, *HOW,
                     names="recording")
        self.refused("calibrate", "--replay", frames, "-o", self.folder / "new", "--levels", 33, *HOW[2:],
                     names="recorded for another pattern")

    def check_lens(self, frames, folder, before):
        """A lens that is in the folder's calibration already is kept, told, and used for the epipolar distances."""
        lens = np.array([104.35, 104.35, 47.5, 35.5, -0.12, 0.02, 0.0005, -0.0004, 0.0, 0.1])
        with h5py.File(folder / "calibration.h5", "a") as file:
            file["camera/lens"] = lens
        answer = answer_of("calibrate", "--replay", frames, "-o", folder, *HOW)
        np.testing.assert_array_equal(contents(folder / "calibration.h5")["camera/lens"], lens)
        self.assertEqual(len(answer["findings"]), len(before["findings"]) + 1)
        self.assertIn("is kept", answer["findings"][-1]["text"])
        kept, straight = answer["geometry"]["epipolar"], before["geometry"]["epipolar"]
        # Of the surest half of the pixels: of all, a few thousandths of a pixel are chance of the matrix that is fitted.
        self.assertLess(kept["sure_median"], straight["sure_median"])

    def check_photometry(self, answer):
        codes = np.linspace(0, 1, 17)
        for response in answer["projector"]["response"]:
            np.testing.assert_allclose(response, decode_srgb(codes), atol=0.005)
        np.testing.assert_allclose(answer["camera"]["response"], codes ** 1.8, atol=0.005)
        np.testing.assert_allclose(answer["projector"]["crosstalk"], np.eye(3), atol=0.002)
        self.assertAlmostEqual(answer["latency"]["seconds"], LATENCY, delta=0.5 / 60)
        self.assertGreater(answer["latency"]["complete"], LATENCY + 0.002)
        self.assertEqual(sum(answer["latency"]["histogram"]["counts"]), answer["latency"]["changes"])
        self.assertFalse(answer["camera"]["linear"])

    def check_exposures(self, answer):
        seconds = [e["seconds"] for e in answer["exposures"]]
        self.assertEqual(seconds, sorted(set(seconds)))
        np.testing.assert_allclose(np.array(seconds) * 120, np.round(np.array(seconds) * 120), atol=1e-6)
        self.assertTrue(all("refresh periods" in e["why"] for e in answer["exposures"]))

    def check_map(self, out):
        """Against what the pixels of the simulated camera really see."""
        write_png(self.folder / "white.png", np.ones((3, PANEL[1], PANEL[0])))
        answer_of("simulate", self.scene, "--drive", self.folder / "white.png", "-o", self.folder / "seen.npy",
                  "--map", self.folder / "true.npy")
        true_x, true_y, lit = np.load(self.folder / "true.npy")
        x, y, confidence = np.load(out / "map.npy")
        both = np.isfinite(x) & (lit == 1)
        self.assertGreater(both.sum(), 0.95 * (lit == 1).sum())
        self.assertLess(np.median(np.hypot(x - true_x, y - true_y)[both]), 0.05)
        self.assertTrue((confidence[np.isnan(x)] == 0).all())

    def check_black(self, answer):
        """Against photographs of the dark and the white panel, pixel by pixel by the true values, the room's light steady:
        means over the pixels that the panel lights to a quarter of the 90th percentile."""
        steady, light = self.folder / "steady.cfg", []
        steady.write_text(re.sub(r"flicker = .*", "", SCENE))
        for drive in (0, 1):
            path = self.folder / "drive.npy"
            np.save(path, np.full((3, PANEL[1], PANEL[0]), drive, "f4"))
            answer_of("simulate", steady, "--drive", path, "-o", self.folder / "seen.npy")
            light.append(np.load(self.folder / "seen.npy").astype(float))
        gain = (light[1] - light[0]).sum(0)
        bright = gain > 0.25 * np.percentile(gain, 90)
        truth = light[0][:, bright].mean(1) / light[1][:, bright].mean(1)
        self.assertGreater(truth.min(), BLACK)
        np.testing.assert_allclose(answer["projector"]["black"], truth, atol=1e-4)

    def check_file(self, out, answer):
        stored = contents(out / "calibration.h5")
        np.testing.assert_allclose(stored["panel/response"][:, ::4], answer["projector"]["response"], atol=1e-12)
        np.testing.assert_allclose(stored["exposures"], [e["seconds"] for e in answer["exposures"]])
        np.testing.assert_array_equal(np.isfinite(stored["map/x"]), stored["map/fate"] == 0)
        self.assertEqual((stored["map/fate"] == 0).sum(), answer["geometry"]["fates"]["decoded"])
        self.assertEqual(stored["@latency"], answer["latency"]["seconds"])

    def check_page(self, out, answer):
        text = (out / "report.html").read_text()
        page = Page(text)
        self.assertEqual((page.open, page.wrong), ([], []))
        self.assertIsNone(re.search(r"(src|href)=\"(?!data:)", text))
        words = " ".join(page.words)
        self.assertIn("flickers", " ".join(f["text"] for f in answer["findings"]))
        self.assertEqual([f for f in answer["findings"] if f["serious"]], [])
        for finding in answer["findings"]:
            self.assertIn(finding["text"], words)
        for heading in ("What is wrong, and what to do", "Responses", "Latency", "Exposures", "calibration.h5"):
            self.assertIn(heading, words)

    def test_usage(self):
        new = ("-o", self.folder / "new")
        self.refused("calibrate", "--scene", self.scene, "--replay", self.folder, *new, names="--replay")
        self.refused("calibrate", "--scene", self.scene, *new, "--levels", 9, names="levels")
        self.refused("calibrate", "--replay", self.folder, "--record", self.folder / "frames", *new, names="--record")
        self.refused("calibrate", "--scene", self.folder / "none.cfg", *new, names="none.cfg")


if __name__ == "__main__":
    main()
