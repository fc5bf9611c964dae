"""counterlight doctor where there are no devices: the shape of its answer, that every defect names a remedy, and that only
what the configuration needs makes it fail."""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv[1]
ROOT = sys.argv[2]
LEVELS = ["good", "note", "warning", "problem"]
AREAS = ["configuration", "projector", "camera", "access", "service", "machine"]


def run(*words, **environment):
    named = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run([PROGRAM, "doctor", *words], text=True, capture_output=True, timeout=60,
                          env={**named, **environment})


def answer(*words, **environment):
    done = run("--json", *words, **environment)
    return done.returncode, json.loads(done.stdout)


def configuration(folder, text, name="station.cfg"):
    path = os.path.join(folder, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def of_level(document, level, area=None):
    return [f for f in document["findings"] if f["level"] == level and area in (None, f["area"])]


class Doctor(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def test_document_has_its_shape(self):
        code, document = answer()
        self.assertEqual(code, 0)
        for finding in document["findings"]:
            self.assertEqual(set(finding), {"level", "area", "what", "advice"})
            self.assertIn(finding["level"], LEVELS)
            self.assertIn(finding["area"], AREAS)
            self.assertTrue(finding["what"])
        self.assertEqual({f["area"] for f in document["findings"]}, set(AREAS))
        self.assertEqual(document["counts"], {level: len(of_level(document, level)) for level in LEVELS})
        for list_of in ("monitors", "cameras"):
            self.assertIsInstance(document[list_of], list)
        for part in ("access", "memory", "processor", "state", "versions"):
            self.assertIsInstance(document[part], dict)

    def test_what_is_wrong_names_a_remedy(self):
        _, document = answer("--config", configuration(self.folder, 'camera = { driver = "v4l2"; device = "no"; };'))
        for finding in of_level(document, "warning") + of_level(document, "problem"):
            self.assertTrue(finding["advice"], finding)

    def test_facts_are_the_machine_s(self):
        _, document = answer(XDG_STATE_HOME=self.folder)
        with open("/proc/meminfo", encoding="ascii") as file:
            total = int(file.readline().split()[1]) / 1024
        self.assertAlmostEqual(document["memory"]["total_mib"], total, delta=1)
        self.assertEqual(document["processor"]["cores"], os.cpu_count())
        with open("/proc/cpuinfo", encoding="ascii") as file:
            self.assertEqual(document["processor"]["avx2"], " avx2 " in file.read())
        self.assertEqual(document["versions"]["linux"], os.uname().release)
        self.assertEqual(document["access"]["uid"], os.geteuid())

    def test_state_directory_is_the_configuration_s(self):
        path = configuration(self.folder, 'daemon = { content = "no.png"; state = "kept/here"; };')
        _, document = answer("--config", path)
        self.assertEqual(document["state"]["path"], os.path.join(self.folder, "kept/here"))
        disk = os.statvfs(self.folder)
        self.assertAlmostEqual(document["state"]["free_mib"], disk.f_bavail * disk.f_frsize / 2**20, delta=256)

    def test_a_working_configuration_passes(self):
        code, document = answer("--config", os.path.join(ROOT, "config", "simulated.cfg"))
        self.assertEqual((code, of_level(document, "problem")), (0, []))
        self.assertIn("OK", " ".join(f["what"] for f in of_level(document, "good", "configuration")))

    def test_a_broken_configuration_fails_with_its_line(self):
        code, document = answer("--config", configuration(self.folder, "\ncamera = { gain = -5; };\n"))
        self.assertEqual(code, 1)
        (problem,) = of_level(document, "problem", "configuration")
        self.assertIn("station.cfg:2", problem["what"])
        self.assertIn("configuration.md", problem["advice"])

    def test_the_daemon_s_section_is_checked_by_the_daemon(self):
        path = configuration(self.folder, 'daemon = { content = "picture.png"; verify_s = -1; };')
        code, document = answer("--config", path)
        self.assertEqual(code, 1)
        self.assertIn("verify_s", of_level(document, "problem", "configuration")[0]["what"])

    def test_a_missing_camera_is_a_problem_only_where_it_is_configured(self):
        for driver in ("v4l2", "libcamera"):
            path = configuration(self.folder, f'camera = {{ driver = "{driver}"; device = "no such"; }};')
            code, document = answer("--config", path)
            self.assertEqual(code, 1)
            problem = of_level(document, "problem", "camera")
            self.assertEqual(len(problem), 1, document["findings"])
            self.assertIn(driver if "build" in problem[0]["what"] else "no such", problem[0]["what"])

    def test_a_missing_display_is_a_problem_only_where_it_is_configured(self):
        code, document = answer("--config", configuration(self.folder, 'projector = { driver = "glfw"; };'))
        self.assertEqual(code, 1)
        self.assertEqual(len(of_level(document, "problem", "projector")), 1, document["findings"])
        self.assertEqual(of_level(answer()[1], "problem"), [])

    def test_no_daemon_is_said_with_its_socket(self):
        _, document = answer(COUNTERLIGHT_SOCKET=os.path.join(self.folder, "none.sock"))
        self.assertIsNone(document["daemon"])
        (note,) = [f for f in document["findings"] if f["area"] == "service"]
        self.assertIn("none.sock", note["what"])

    def test_text_says_the_same(self):
        done, (code, document) = run(), answer()
        self.assertEqual((done.returncode, done.stderr), (code, ""))
        for area in AREAS:
            self.assertIn(f"\n{area}\n" if area != AREAS[0] else f"{area}\n", done.stdout)
        lines = done.stdout.splitlines()
        for finding in document["findings"]:
            if finding["area"] not in ("machine",):
                self.assertIn(f"  {finding['level']:8} {finding['what']}", lines)
        self.assertEqual(run("-q").stdout, "")


class Display(unittest.TestCase):
    """On an X server of its own, drawn by the processor."""

    def setUp(self):
        if any("glfw is not in this build" in f["what"] for f in answer()[1]["findings"]):
            self.skipTest("the driver glfw is not in this build")
        if shutil.which("Xvfb") is None:
            self.skipTest("there is no Xvfb")
        reading, writing = os.pipe()
        server = subprocess.Popen(["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x800x24", "-nolisten", "tcp"],
                                  pass_fds=[writing], stderr=subprocess.DEVNULL)
        self.addCleanup(server.wait)
        self.addCleanup(server.terminate)
        os.close(writing)
        with os.fdopen(reading) as number:
            self.display = ":" + number.readline().strip()

    def ask(self, text):
        with tempfile.TemporaryDirectory() as folder:
            # Mesa's driver is unloaded with what it leaks, which no suppression can name then.
            return answer("--config", configuration(folder, text), DISPLAY=self.display, LIBGL_ALWAYS_SOFTWARE="1",
                          LSAN_OPTIONS="detect_leaks=0")

    def test_monitor_and_renderer(self):
        code, document = self.ask('projector = { driver = "glfw"; };')
        self.assertEqual((code, of_level(document, "problem")), (0, []))
        (monitor,) = document["monitors"]
        self.assertEqual([monitor[k] for k in ("x", "y", "width", "height", "primary", "chosen")],
                         [0, 0, 1280, 800, True, True])
        self.assertTrue(document["display"]["software"])
        said = " ".join(f["what"] for f in of_level(document, "warning", "projector"))
        self.assertIn("primary", said)
        self.assertIn(document["display"]["renderer"], said)

    def test_a_monitor_that_is_not_there(self):
        code, document = self.ask('projector = { driver = "glfw"; monitor = "HDMI-7"; };')
        self.assertEqual(code, 1)
        (problem,) = of_level(document, "problem", "projector")
        self.assertIn("HDMI-7", problem["what"])
        self.assertIn(document["monitors"][0]["name"], problem["what"])
        self.assertFalse(document["monitors"][0]["chosen"])

    def test_its_name_is_what_to_write(self):
        _, document = self.ask("")
        name = document["monitors"][0]["name"]
        code, document = self.ask(f'projector = {{ driver = "glfw"; monitor = "{name}"; }};')
        self.assertEqual((code, document["monitors"][0]["chosen"]), (0, True))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=0)
