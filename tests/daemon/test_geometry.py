"""The geometry measured again by the daemon, for a camera that was knocked."""
import os
import subprocess

import h5py
import numpy as np

from exhibit import PATIENCE, exhibit, main, wait_for
from test_loop import RETRY, verified
from test_renew import reacquire

ROOM = """
seed = 3;
grid = { width = 16; height = 12; channels = 3; };
projector = { position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.4, 0.3]; intensity = 40.0; bits = 12; };
camera = { pixels = [96, 72]; fps = 60; position = [0.75, -3.1, 0.35]; target = [%s, 0.0, %s]; tangent = [0.46, 0.345]; };
materials = ( { name = "m"; albedo = [0.7, 0.6, 0.5]; } );
surfaces = ( { corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "m"; },
             { corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "m"; } );
"""
STRAIGHT, KNOCKED, AWAY = (-0.08, -0.05), (-0.15, -0.08), (1.2, 0.9)


def program(*words):
    done = subprocess.run([os.environ["CLT_PROGRAM"], *map(str, words)], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr


def turn(run, target):
    (run.folder / "room.cfg").write_text(ROOM % target)


def prepare(run, calibrated=[]):
    """A calibrated station; all of them by one measurement."""
    turn(run, STRAIGHT)
    folder = run.folder / "cal"
    if not calibrated:
        program("calibrate", "--scene", run.folder / "room.cfg", "-o", folder, "--levels", 17, "--frames", 2, "--watch", 0)
        calibrated.append((folder / "calibration.h5").read_bytes())
    folder.mkdir(exist_ok=True)
    (folder / "calibration.h5").write_bytes(calibrated[0])
    run.write_config(station='rig = { calibration = "cal/calibration.h5"; };', daemon=f"verify_minutes = 0; {RETRY}")


def kept(path):
    with h5py.File(path) as file:
        return {name: file[f"map/{name}"][:] for name in ("x", "y", "fate")}, dict(file.attrs), file["camera/response"][:]


def true_moved(run):
    """Camera pixels by which what a pixel sees has moved, from the scene's own maps."""
    maps = []
    for target in (STRAIGHT, KNOCKED):
        turn(run, target)
        np.save(run.folder / "drive.npy", np.ones((3, 12, 16), "f4"))
        program("simulate", run.folder / "room.cfg", "--drive", run.folder / "drive.npy", "-o", run.folder / "seen.npy",
                "--map", run.folder / "map.npy")
        maps.append(np.load(run.folder / "map.npy"))
    both = (maps[0][2] == 1) & (maps[1][2] == 1)
    panel = np.median(np.hypot(*(maps[0][:2] - maps[1][:2])[:, both]))
    return panel, maps[1]


def a_knocked_camera_is_measured_again_and_that_survives():
    with exhibit() as run:
        prepare(run)
        run.start()
        first = run.wait_state("showing")
        assert verified(run)["fits"]
        assert run.stop()[0] == 0
        panel, true = true_moved(run)
        configured = kept(run.folder / "cal" / "calibration.h5")
        run.start()
        run.wait_state("showing")
        bad = verified(run)
        assert not bad["fits"], bad
        found, good = reacquire(run, "geometry")
        assert found["geometry"]["adopted"] and found["geometry"]["why"] is None, found
        assert good["fits"] and good["error"] < 0.5 * bad["error"], (bad, good)
        now = kept(run.state / "calibration.h5")
        assert abs(found["geometry"]["moved"] - panel / configured[1]["pitch"]) < 0.1, (found, panel)
        both = (now[0]["fate"] == 0) & (true[2] == 1)
        off = np.hypot(now[0]["x"] - true[0], now[0]["y"] - true[1])[both]
        was = np.hypot(configured[0]["x"] - true[0], configured[0]["y"] - true[1])[both]
        print(f"moved {found['geometry']['moved']:.2f} camera pixels; map off by {np.median(off):.3f} panel pixels, "
              f"before by {np.nanmedian(was):.3f}; picture off by {bad['error']:.4f}, then {good['error']:.4f}; "
              f"T {found['done']} by {found['patterns']} patterns of {first['transport']['patterns']}")
        assert np.median(off) < 0.06 and np.median(off) < 0.15 * np.nanmedian(was)
        assert found["off_before"] < 0.06 and bad["off"] > 0.2, (found, bad)  # the map alone explains most of it
        assert (now[2] == configured[2]).all() and now[1]["latency"] == configured[1]["latency"]
        same = kept(run.folder / "cal" / "calibration.h5")  # the installer's own file is not touched
        assert (same[0]["fate"] == configured[0]["fate"]).all() and same[1]["calibrated"] == configured[1]["calibrated"]
        run.stop()
        run.start()  # uses the newer one
        run.wait_state("showing")
        assert verified(run)["fits"]
        run.stop()
        with h5py.File(run.folder / "cal" / "calibration.h5", "r+") as file:  # an installer calibrates later
            file.attrs["calibrated"] = now[1]["calibrated"] + 5
        run.start()
        run.wait_state("showing")
        assert not verified(run)["fits"]
        assert run.stop()[0] == 0


def one_that_is_interrupted_is_owed_and_a_worse_one_is_not_adopted():
    with exhibit() as run:
        prepare(run)
        run.start()
        run.wait_state("showing")
        with run.client() as client:
            client.ask("subscribe")
            client.ask("reacquire", scope="geometry")
            client.ask("hold")
            wait_for("holding", lambda: client.ask("status")["state"] == "holding")
            assert not (run.state / "calibration.h5").exists()
            client.notifications.clear()
            client.ask("resume")
            notes = client.until("showing")
        found = [n["params"] for n in notes if n["method"] == "reacquired"]
        assert len(found) == 1 and found[0]["geometry"]["adopted"] and found[0]["geometry"]["moved"] < 0.2, found
        run.stop()
        before = (run.state / "calibration.h5").read_bytes()
        turn(run, AWAY)
        run.start()
        run.wait_state("showing")
        found = reacquire(run, "geometry")[0]
        assert found["done"] == "kept" and not found["geometry"]["adopted"], found
        assert "of the panel where it saw" in found["geometry"]["why"], found
        assert run.status()["state"] == "showing" and (run.state / "calibration.h5").read_bytes() == before
        assert "the earlier geometry stays" in run.said()
        assert run.stop()[0] == 0


if __name__ == "__main__":
    main([a_knocked_camera_is_measured_again_and_that_survives,
          one_that_is_interrupted_is_owed_and_a_worse_one_is_not_adopted])
