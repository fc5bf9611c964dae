"""Runs a test of real device drivers in the guest of tests/vm, in virtual time, and skips where there is none.

    test_in_guest.py SCRIPT ARGUMENTS...

The runner is $CLT_VM_RUN (a command line) or tests/vm/run of this tree."""
import os
import pathlib
import shlex
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
SKIP = 77  # which the runner returns as well, where it finds no kernel


def main():
    runner = shlex.split(os.environ.get("CLT_VM_RUN", str(HERE.parent / "vm" / "run")))
    if not os.access(runner[0], os.X_OK):
        print(f"skipped: {runner[0]} is not there, which would start a kernel with cameras")
        return SKIP
    if shutil.which("v4l2-ctl") is None:
        print("skipped: v4l2-ctl is not installed (package v4l-utils)")
        return SKIP
    script = HERE / sys.argv[1]
    command = [sys.executable, "-B", str(script), *(os.path.abspath(a) for a in sys.argv[2:])]
    done = subprocess.run([*runner, "-v", "-t", "240", shlex.join(command)], text=True, stdout=subprocess.PIPE, check=False)
    print(done.stdout)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
