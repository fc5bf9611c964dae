"""What a user can get wrong: one clear line, exit 2, nothing written and nothing overwritten."""
import h5py
import numpy as np

from support import PathTest, main, room, run, write_png, write_transport

WIDTH, HEIGHT = 6, 4
SCENE = """
grid = { width = 4; height = 3; channels = 1; };
materials = ( { name = "white"; albedo = 0.5; } );
surfaces = ( { corner = [-2.0, 0.0, -2.0]; u = [4.0, 0.0, 0.0]; v = [0.0, 0.0, 4.0]; material = "white"; } );
"""


class BadInput(PathTest):
    def setUp(self):
        super().setUp()
        self.good = self.folder / "T.h5"
        self.dense = room(WIDTH, HEIGHT, 1, 0.4)
        write_transport(self.good, self.dense, WIDTH, HEIGHT)
        self.picture, self.out = self.folder / "picture.png", self.folder / "out.png"
        write_png(self.picture, np.full((1, HEIGHT, WIDTH), 0.5))
        self.out.write_bytes(b"an earlier result")

    def compensate(self, transport=None, target=None, out=None, *options, **expected):
        return self.refused("compensate", transport or self.good, "--target", target or self.picture, "-o",
                            out or self.out, *options, **expected)

    def test_transport_that_is_missing_or_truncated(self):
        self.compensate(self.folder / "none.h5", names="none.h5")
        whole = self.good.read_bytes()
        for size in (0, 7, 600, len(whole) // 2, len(whole) - 40):
            short = self.folder / "short.h5"
            short.write_bytes(whole[:size])
            for command in ("compensate", "inspect"):
                words = ("--target", self.picture, "-o", self.out) if command == "compensate" else ()
                self.refused(command, short, *words, names="short.h5")

    def test_transport_with_impossible_entries(self):
        for name, value in (("nan", np.nan), ("infinite", np.inf), ("negative", -0.5)):
            dense = self.dense.copy()
            dense[0, 3, 5] = value
            path = self.folder / f"{name}.h5"
            write_transport(path, dense, WIDTH, HEIGHT)
            self.compensate(path, names=path.name)

    def test_transport_that_no_drive_lights(self):
        dark = self.folder / "dark.h5"
        write_transport(dark, 0 * self.dense, WIDTH, HEIGHT, np.full((1, WIDTH * HEIGHT), 0.1))
        self.compensate(dark, names="no cell of this transport is lit")
        self.refused("bounces", dark, "--drive", self.picture, "-o", self.folder / "bounces", names="dark.h5")
        self.refused("repaint", dark, "--photo", self.picture, "--drive", self.picture, "-o", self.out,
                     names="dark.h5")
        self.assertEqual(run("inspect", dark).returncode, 0)

    def test_blocks_without_a_block(self):
        empty, cells = self.folder / "empty.h5", WIDTH * HEIGHT
        with h5py.File(empty, "w") as file:
            file.attrs.update(format="counterlight-transport", version=1, width=WIDTH, height=HEIGHT, channels=1)
            for name, values in {"block": np.zeros(cells, "i4"), "flux": np.ones(cells, "f4"),
                                 "column": np.zeros((1, 0, cells), "f4"), "start": np.arange(cells + 1),
                                 "cell": np.arange(cells), "value": np.ones((1, cells), "f4")}.items():
                file["blocks/" + name] = values
        self.assertIn("one at least", self.compensate(empty, names="/blocks/column"))

    def test_transport_of_a_wrong_shape(self):
        wrong = self.folder / "wrong.h5"
        write_transport(wrong, self.dense, WIDTH + 1, HEIGHT)
        self.compensate(wrong, names="wrong.h5")
        write_transport(wrong, self.dense, WIDTH, HEIGHT)
        with h5py.File(wrong, "a") as file:
            file.attrs["format"] = "something else"
        self.compensate(wrong, names="wrong.h5")
        with h5py.File(wrong, "a") as file:
            file.attrs["format"], file.attrs["response"] = "counterlight-transport", "no curve"
        self.compensate(wrong, names="wrong.h5")

    def test_npy_that_does_not_fit_names_both_sizes(self):
        for shape in ((1, HEIGHT, WIDTH + 1), (3, HEIGHT, WIDTH), (1, WIDTH, HEIGHT)):
            path = self.folder / "odd.npy"
            np.save(path, np.full(shape, 0.5, "f4"))
            line = self.compensate(None, path, names="odd.npy")
            self.assertIn(" x ".join(map(str, shape)), line)
            self.assertIn(f"1 x {HEIGHT} x {WIDTH}", line)

    def test_picture_that_is_none(self):
        self.compensate(None, self.folder / "none.png", names="none.png")
        for ending in ("png", "jpg", "exr", "npy"):
            path = self.folder / f"text.{ending}"
            path.write_text("this is no picture\n")
            self.compensate(None, path, names=path.name)
        unknown = self.folder / "picture.xyz"
        unknown.write_bytes(self.picture.read_bytes())
        self.compensate(None, unknown, names="picture.xyz")
        self.compensate(None, self.folder, names=self.folder.name)

    def test_picture_with_impossible_values(self):
        for value in (np.nan, np.inf, -0.25):
            path = self.folder / "values.npy"
            samples = np.full((1, HEIGHT, WIDTH), 0.5, "f4")
            samples[0, 2, 1] = value
            np.save(path, samples)
            self.compensate(None, path)

    def test_unknown_method_lists_those_that_exist(self):
        line = self.compensate(None, None, None, "--method", "magic", names="magic")
        self.assertIn("bounded", line)

    def test_options_out_of_range(self):
        for option, value in (("--tolerance", "0"), ("--tolerance", "fast"), ("--deadline-ms", "-1"),
                              ("--white", "0"), ("--white", "grey"), ("--white", "-2")):
            self.compensate(None, None, None, option, value)

    def test_output_that_cannot_be_written(self):
        self.compensate(None, None, self.folder / "no" / "out.png", names="no")
        self.compensate(None, None, self.folder / "out.xyz", names="out.xyz")
        (self.folder / "taken.png").mkdir()
        self.compensate(None, None, self.folder / "taken.png", names="taken.png")
        self.compensate(None, None, None, "--predict", self.folder / "no" / "seen.png", names="no")
        self.refused("relight", self.good, "--light", self.picture, "-o", self.folder / "no" / "y.png", names="no")

    def test_missing_arguments(self):
        self.refused("compensate", self.good, "-o", self.out, names="--target PIC")
        self.refused("compensate", self.good, "--target", self.picture, names="--output OUT")
        self.refused("compensate", self.good, "--target", names="--target")
        self.refused("relight", self.good, "-o", self.out, names="--light")
        self.refused("inspect", names="T.h5 is missing")
        self.refused("scene", "explain", names="SCENE is missing")
        self.refused("acquire", "-o", self.folder / "new.h5", names="--config")
        self.refused("acquire", "--scene", "s.cfg", names="--output")
        self.refused("simulate", "s.cfg", "-o", self.out, names="--drive")

    def test_drive_outside_its_range(self):
        scene = self.folder / "scene.cfg"
        scene.write_text(SCENE)
        drive = self.folder / "drive.npy"
        np.save(drive, np.full((1, 3, 4), 1.2, "f4"))
        self.refused("simulate", scene, "--drive", drive, "-o", self.out, names="drive.npy")

    def test_scene_and_scheme(self):
        scene, new = self.folder / "scene.cfg", self.folder / "new.h5"
        self.refused("acquire", "--scene", self.folder / "none.cfg", "-o", new, names="none.cfg")
        scene.write_text(SCENE.replace("width", "widht"))
        self.assertIn("scene.cfg:2", self.refused("acquire", "--scene", scene, "-o", new, names="widht"))
        scene.write_text(SCENE)
        self.refused("acquire", "--scene", scene, "-o", new, "--scheme", "magic", names="magic")
        self.refused("acquire", "--scene", scene, "-o", new, "--repeats", "0", names="--repeats")
        self.refused("acquire", "--scene", scene, "--config", scene, "-o", new, names="either")
        self.refused("demo", "--scene", self.folder / "none.cfg", "-o", self.folder / "demo", names="none.cfg")
        self.refused("demo", "--scene", scene, "--target", self.folder / "none.png", "-o", self.folder / "demo",
                     names="none.png")
        self.refused("demo", "--scene", scene, "-o", self.out, names="out.png")
        self.refused("demo", "--scene", scene, "-o", self.folder / "no" / "demo", names="no")


if __name__ == "__main__":
    main()
