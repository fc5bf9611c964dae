"""The daemon with its real drivers, in the guest, against the same daemon on the same room simulated: what appears, as
the room measures it, is as near to the target as there, within 1.5x.

    test_closed_loop.py DRIVERS COUNTERLIGHT COUNTERLIGHTD CAMERA ROOM"""
import json
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

import numpy as np

import station

HERE = pathlib.Path(__file__).resolve().parent
SKIP = 77


def simulated(counterlight, counterlightd):
    """Error of what appears with the simulated rig."""
    with tempfile.TemporaryDirectory() as name:
        seen = os.path.join(name, "seen.npy")
        with station.Station(name, counterlight, counterlightd, f'scene = "{station.SCENE}";') as exhibit:
            exhibit.calibrate()
            exhibit.start()
            exhibit.wait_state("showing")
            drive = exhibit.folder / "state" / "drive.npy"
            subprocess.run([counterlight, "simulate", station.SCENE, "-q", "--exact", "--drive", drive, "-o", seen], check=True)
        return station.error_of(np.load(seen))


def in_guest(*arguments):
    """The answers of loop_in_guest.py, or None where there is no guest."""
    command = shlex.join([sys.executable, "-B", str(HERE / "loop_in_guest.py"), *arguments])
    done = subprocess.run([HERE / "run", "-v", "-t", "1100", command], text=True, stdout=subprocess.PIPE, check=False)
    print(done.stdout)
    if done.returncode == SKIP:
        return None
    assert done.returncode == 0, done.returncode
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{"driver"')]


def main():
    drivers, *programs = sys.argv[1], *map(os.path.abspath, sys.argv[2:])
    answers = in_guest(drivers, *programs)
    if answers is None:
        return SKIP
    expected = simulated(*programs[:2])
    print(f"error {expected:.4f} on the simulated rig")
    assert [answer["driver"] for answer in answers] == drivers.split(","), answers
    for answer in answers:
        print(f"error {answer['error']:.4f} with {answer['driver']} ({answer['before']:.4f} uncompensated)")
        assert answer["error"] <= min(1.5 * expected, 0.1 * answer["before"]), answer
    return 0


if __name__ == "__main__":
    sys.exit(main())
