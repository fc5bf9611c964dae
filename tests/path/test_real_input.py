"""The CC0 photograph as target, on the dihedral and on a transport that an independent path tracer rendered."""
import sys

import h5py
import numpy as np

from support import (SHARED, SOURCE, PathTest, answer_of, appearance, best_gain, decode_srgb, main, read_png,
                     relative_error)

COFFEE, CYCLES = SHARED / "data" / "coffee.png", SHARED / "data" / "cycles-dihedral.h5"


class RealInput(PathTest):
    def demo(self, scene):
        self.out = self.folder / "out"
        answer = answer_of("demo", "--scene", scene, "--target", COFFEE, "-o", self.out, timeout=600)
        self.assertLessEqual(answer["error_after"], max(1.25 * answer["error_limit"], 0.01))
        self.assertGreaterEqual(answer["error_before"], 3 * answer["error_after"])
        return answer

    def test_coffee_on_the_dihedral(self):
        answer = self.demo(SOURCE / "config" / "scenes" / "dihedral.cfg")
        self.assertEqual(answer["grid"], {"width": 64, "height": 48, "channels": 3})

    def test_coffee_on_a_rendered_transport(self):
        scene = self.folder / "cycles.cfg"
        scene.write_text(f'transport_file = "{CYCLES.resolve()}";\n')
        answer = self.demo(scene)
        with h5py.File(CYCLES) as file:
            dense, black = file["dense"][:].astype(float), file["black"][:].astype(float)
        picture = decode_srgb(read_png(self.out / "target.png")).reshape(1, -1)
        drive = decode_srgb(read_png(self.out / "pattern.png")).reshape(1, -1)
        target = answer["white"][0] * picture
        after = relative_error(appearance(dense, black, drive), target)
        self.assertAlmostEqual(after, answer["error_after"], delta=0.005)
        plain = appearance(dense, black, picture)
        before = relative_error(best_gain(plain, target) * plain, target)
        self.assertAlmostEqual(before, answer["error_before"], delta=0.01)


if __name__ == "__main__":
    if not (COFFEE.exists() and CYCLES.exists()):
        print(f"skipped: {SHARED}/data is not there (CLT_SHARED names the folder)")
        sys.exit(77)
    main()
