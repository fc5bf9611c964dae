"""Every command describes itself, and refuses what it does not know with one line and exit code 2."""
import json
import subprocess
import sys
import unittest

PROGRAM = sys.argv[1]
COMMANDS = ("demo doctor calibrate acquire compensate relight bounces separate repaint inspect tradeoff reproduce bench simulate "
            "scene status show watch reacquire refine snapshot hold resume reload").split()


def run(*words, timeout=60):
    return subprocess.run([PROGRAM, *words], text=True, capture_output=True, timeout=timeout)


class Help(unittest.TestCase):
    def test_lists_every_command_with_one_line(self):
        answer = run("--help")
        self.assertEqual((answer.returncode, answer.stderr), (0, ""))
        listed = [line.split() for line in answer.stdout.splitlines() if line.startswith("  ")]
        self.assertEqual(sorted(words[0] for words in listed), sorted(COMMANDS))
        self.assertTrue(all(len(words) > 3 for words in listed))

    def test_every_command_describes_itself(self):
        for name in COMMANDS:
            answer = run(name, "--help")
            self.assertEqual((answer.returncode, answer.stderr), (0, ""), name)
            self.assertTrue(answer.stdout.startswith(f"usage: counterlight {name}"), answer.stdout)
            for option in ("--json", "--quiet", "--help"):
                self.assertIn(option, answer.stdout, name)
            self.assertEqual(answer.stdout, run(name, "-h").stdout)

    def test_version_is_one_line(self):
        answer = run("--version")
        self.assertRegex(answer.stdout, r"^counterlight \d+\.\d+\.\d+\n$")
        self.assertEqual(answer.returncode, 0)

    def test_every_command_refuses_an_unknown_option(self):
        for name in COMMANDS:
            answer = run(name, "--no-such-option")
            self.assertEqual((answer.returncode, answer.stdout), (2, ""), name)
            self.assertEqual(answer.stderr.count("\n"), 1, answer.stderr)
            self.assertTrue(answer.stderr.startswith(f"counterlight {name}: "), answer.stderr)
            self.assertIn("--no-such-option", answer.stderr)

    def test_bad_usage_is_exit_2(self):
        for words in ([], ["nonsense"], ["--nonsense"], ["compensate"], ["inspect", "a", "b"], ["scene", "explain"], ["scene", "what", "a"], ["demo", "surplus"]):
            answer = run(*words)
            self.assertEqual((answer.returncode, answer.stdout), (2, ""), words)
            self.assertTrue(answer.stderr)


class Bench(unittest.TestCase):
    def test_json_has_what_scripts_read(self):
        answer = run("bench", "--json", "--no-scaling", "--frames", "10", timeout=240)
        self.assertEqual((answer.returncode, answer.stderr), (0, ""))
        report = json.loads(answer.stdout)
        self.assertGreater(report["bandwidth_gbs"], 0)
        for kernel in report["kernels"]:
            self.assertLessEqual({"name", "bytes", "bytes_per_cell", "ms", "fraction"}, set(kernel))
            self.assertAlmostEqual(kernel["bytes_per_cell"] * report["frame"]["cells"], kernel["bytes"], 3)
        self.assertEqual((report["frame"]["cells"], report["frame"]["channels"]), (131072, 3))
        self.assertLessEqual(report["frame"]["p50_ms"], report["frame"]["p99_ms"])
        self.assertIn("report-jacobi-csr-f32", [peer["name"] for peer in report["peers"]])
        for peer in report["peers"]:
            self.assertLessEqual({"ms", "warm_ms", "error", "ratio", "warm_ratio", "entries"}, set(peer))
        self.assertEqual(report["scaling"], {"exponent": None, "points": []})


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=0)
