"""In the guest, in virtual time, where programs take none: what the projector's driver makes of a compositor's refreshes.

    guest_pacing.py PACING_PROBE [FRAMES]

cage on a screen without a monitor: wlroots lets it refresh every 16 ms and calls that 60 Hz. Where GLFW speaks Wayland
its swaps wait for them; where it speaks X11, by Xwayland without a graphics processor, they wait for nothing, and
the driver's clock makes 60 Hz."""
import json
import os
import pwd
import shutil
import subprocess
import sys
import tempfile

SKIP = 77


def under_cage(command):
    """What the command prints, run by a user on cage's screen: cage does not serve root."""
    user = pwd.getpwnam("nobody")
    os.makedirs("/tmp/.X11-unix", exist_ok=True)
    os.chmod("/tmp/.X11-unix", 0o1777)
    place = tempfile.mkdtemp()
    os.chown(place, user.pw_uid, user.pw_gid)
    environment = dict(os.environ, HOME=place, XDG_RUNTIME_DIR=place, WLR_BACKENDS="headless", WLR_RENDERER="pixman",
                       WLR_LIBINPUT_NO_DEVICES="1")
    done = subprocess.run(["cage", "--", *command], env=environment, user=user.pw_uid, group=user.pw_gid, extra_groups=[],
                          stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout


def main():
    if shutil.which("cage") is None:
        print("skipped: cage is not installed")
        return SKIP
    frames = int(sys.argv[2]) if len(sys.argv) > 2 else 240
    answer = under_cage([sys.argv[1], str(frames)])
    print(answer)
    pace = json.loads(answer.splitlines()[-1])
    assert pace["frames"] == frames and abs(pace["refresh_ms"] - 1000 / 60) < 1e-3, pace
    assert min(abs(pace["told_ms"] - period) for period in (16, 1000 / 60)) < 0.1, pace
    for who in ("told_on_time", "seen_on_time"):
        assert pace[who] >= 0.999 * frames, (who, pace)
    return 0


if __name__ == "__main__":
    sys.exit(main())
