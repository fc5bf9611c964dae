"""calibrate --lens on rendered photographs of a chessboard, against the lens that they were rendered with."""
import h5py
import numpy as np

from support import PathTest, answer_of, main, write_png

WIDTH, HEIGHT, COLUMNS, ROWS = 480, 360, 9, 6
FOCAL, CENTRE, BEND = (420.0, 424.0), (244.5, 177.25), (-0.21, 0.08, 0.001, -0.0015, 0.0)


def undistort(x, y):
    """Pixels to X/Z, Y/Z, by fixed-point iteration on Brown's model."""
    u, v = (x - CENTRE[0]) / FOCAL[0], (y - CENTRE[1]) / FOCAL[1]
    k1, k2, p1, p2, k3 = BEND
    a, b = u, v
    for _ in range(20):
        r = a * a + b * b
        s = 1 + r * (k1 + r * (k2 + r * k3))
        a, b = ((u - 2 * p1 * a * b - p2 * (r + 2 * a * a)) / s, (v - p1 * (r + 2 * b * b) - 2 * p2 * a * b) / s)
    return a, b


def photograph(pose):
    """Light of a tilted board of unit squares with a white margin, 3 x 3 rays a pixel, as an sRGB picture."""
    tilt, turn = 0.5 * np.sin(1.7 * pose), 0.5 * np.cos(2.3 * pose)
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    about_y = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    axes = about_y @ about_x
    middle = np.array([0.9 * np.sin(pose), 0.7 * np.cos(1.3 * pose), 13.0 + 2 * np.sin(1.1 * pose)])
    corner = middle - axes @ np.array([(COLUMNS - 1) / 2, (ROWS - 1) / 2, 0])
    steps = (np.arange(3) - 1) / 3
    x = (np.arange(WIDTH)[:, None] + steps).ravel()
    y = (np.arange(HEIGHT)[:, None] + steps).ravel()
    a, b = undistort(*np.meshgrid(x, y))
    rays = np.stack([a, b, np.ones_like(a)])
    depth = (axes[:, 2] @ corner) / np.tensordot(axes[:, 2], rays, 1)
    u, v = np.tensordot(axes[:, :2].T, rays * depth - corner[:, None, None], 1)
    on = (u >= -2) & (u <= COLUMNS + 1) & (v >= -2) & (v <= ROWS + 1)
    margin = (u < -1) | (v < -1) | (u > COLUMNS) | (v > ROWS)
    white = margin | ((np.floor(u) + np.floor(v)) % 2 != 0)
    light = np.where(on, np.where(white, 0.8, 0.05), 0.2).reshape(HEIGHT, 3, WIDTH, 3).mean((1, 3))
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)[None]


def write_calibration(path, width=WIDTH):
    """A file of the format, of a camera that was not really calibrated."""
    straight = np.linspace(0, 1, 65)
    with h5py.File(path, "w") as file:
        file.attrs.update(format="counterlight-calibration", version=1, panel_width=16, panel_height=12,
                          camera_width=width, camera_height=HEIGHT, channels=1, black_level=64.0, full_well=15000.0,
                          read_noise=3.0, latency=0.02, jitter=0.001, complete=0.03, pitch=0.05, covered=1.0,
                          calibrated=1000, source="a test")
        file["panel/response"], file["camera/response"] = straight[None], straight
        file["black"], file["exposures"] = np.array([0.001]), np.array([0.01])
        file["map/x"], file["map/y"] = np.zeros((HEIGHT, width), "f4"), np.zeros((HEIGHT, width), "f4")
        file["map/confidence"], file["map/fate"] = np.zeros((HEIGHT, width), "f4"), np.ones((HEIGHT, width), "u1")


class CalibrateLens(PathTest):
    rendered = None

    def setUp(self):
        super().setUp()
        self.out, self.photographs = self.folder / "out", self.folder / "boards"
        self.out.mkdir()
        self.photographs.mkdir()
        self.rendered = self.rendered or [photograph(pose) for pose in range(7)]
        type(self).rendered = self.rendered
        for pose, picture in enumerate(self.rendered):
            write_png(self.photographs / f"{pose}.png", picture)

    def test_the_lens_is_found_and_kept(self):
        path = self.out / "calibration.h5"
        write_calibration(path)
        answer = answer_of("calibrate", "--lens", self.photographs, "-o", self.out)
        print(answer)
        self.assertEqual((answer["photographs"], answer["found"]), (7, 7))
        self.assertLess(answer["reprojection"], 0.1)
        np.testing.assert_allclose(answer["focal"], FOCAL, rtol=0.005)
        np.testing.assert_allclose(answer["centre"], CENTRE, atol=2)
        with h5py.File(path) as file:
            lens = file["camera/lens"][:]
            self.assertEqual(file.attrs["latency"], 0.02)
            self.assertEqual(file["map/fate"].shape, (HEIGHT, WIDTH))
        np.testing.assert_allclose(lens, answer["focal"] + answer["centre"] + answer["distortion"] +
                                   [answer["reprojection"]], rtol=1e-6)
        # Where the two lenses put directions within the picture; a focal length of half a percent is 0.8 pixels at its edge.
        x, y = np.meshgrid(np.linspace(-0.45, 0.45, 19), np.linspace(-0.33, 0.33, 13))
        away = np.abs(seen_at(lens, x, y) - seen_at(FOCAL + CENTRE + BEND, x, y)).max()
        print(f"directions within the picture are {away:.2f} pixels off at most")
        self.assertLess(away, 1)
        again = answer_of("calibrate", "--lens", self.photographs, "-o", self.out)  # what was kept is read again
        self.assertEqual(answer, again)

    def test_refusals(self):
        new = ("-o", self.out)
        lens = ("calibrate", "--lens", self.photographs)
        self.refused(*lens, *new, names="calibrate the devices first")
        write_calibration(self.out / "calibration.h5", WIDTH - 8)
        self.refused(*lens, *new, names="472 x 360")
        write_calibration(self.out / "calibration.h5")
        before = (self.out / "calibration.h5").read_bytes()
        self.refused(*lens, *new, "--board", "9", names="--board")
        self.refused(*lens, *new, "--board", "7x8", names="is whole in")
        self.refused(*lens, *new, "--scene", "x.cfg", names="--scene")
        self.assertEqual((self.out / "calibration.h5").read_bytes(), before)


def seen_at(lens, x, y):
    """Pixels of X/Z, Y/Z."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens[:9]
    r = x * x + y * y
    s = 1 + r * (k1 + r * (k2 + r * k3))
    return np.stack([fx * (x * s + 2 * p1 * x * y + p2 * (r + 2 * x * x)) + cx,
                     fy * (y * s + p1 * (r + 2 * y * y) + 2 * p2 * x * y) + cy])


if __name__ == "__main__":
    main()
