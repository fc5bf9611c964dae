"""counterlight doctor in the guest, with the simulated USB camera behind the real uvcvideo: what is automatic is found and
nothing is touched; a configuration that fits passes, one that does not fails with the right advice.

    guest_doctor.py COUNTERLIGHT CAMERA"""
import json
import os
import pathlib
import subprocess
import sys
import time

NODE_WAIT_S = 20
AUTOMATIC = {"auto_exposure": 3, "white_balance_automatic": 1}  # as the camera is plugged in


def doctor(program, folder, camera=None):
    words = [program, "doctor", "--json"]
    if camera is not None:
        path = pathlib.Path(folder, "station.cfg")
        path.write_text("camera = { driver = \"v4l2\"; " + camera + " };\n", encoding="utf-8")
        words += ["--config", str(path)]
    done = subprocess.run(words, text=True, stdout=subprocess.PIPE, timeout=60)
    return done.returncode, json.loads(done.stdout)


def of(document, level):
    return [f for f in document["findings"] if f["level"] == level and f["area"] == "camera"]


def controls():
    lines = subprocess.run(["v4l2-ctl", "-d", "/dev/video0", "--list-ctrls"], check=True, text=True,
                           stdout=subprocess.PIPE).stdout.splitlines()
    return {l.split()[0]: int(l.split("value=")[1].split()[0]) for l in lines if "value=" in l}


def check_camera(program, folder):
    code, document = doctor(program, folder)
    assert code == 0, document
    (camera,) = [c for c in document["cameras"] if c["driver"] == "v4l2"]
    assert camera["usb_mbit_s"] == 480 and camera["node"] == "/dev/video0", camera
    (sizes,) = [f["sizes"] for f in camera["formats"] if f["format"] == "YUYV" and f["read"]]
    assert {(s["width"], s["height"]) for s in sizes} == {(640, 480)}, sizes
    return camera


def check_automatic(program, folder):
    before = controls()
    assert {k: before[k] for k in AUTOMATIC} == AUTOMATIC, before
    _, document = doctor(program, folder)
    found = {f["what"]: f["advice"] for f in of(document, "note") if "automatic" in f["what"]}
    for name, remedy in (("Auto Exposure", "auto_exposure=1"), ("White Balance, Automatic", "white_balance_automatic=0")):
        (advice,) = [a for w, a in found.items() if name in w]
        assert f"v4l2-ctl -d /dev/video0 -c {remedy}" in advice, advice
    assert controls() == before, "the doctor changed the camera"
    for advice in found.values():
        subprocess.run(advice[advice.index("v4l2-ctl"):].split(), check=True)
    _, document = doctor(program, folder)
    assert not [f for f in of(document, "note") if "automatic" in f["what"]], document["findings"]


def check_configurations(program, folder, camera):
    for text in ("", f"device = \"{camera['device']}\";", 'device = "usb:1d6b:0104";',
                 'format = "YUYV"; width = 640; height = 480;'):
        code, document = doctor(program, folder, text)
        assert code == 0 and not of(document, "problem"), (text, document["findings"])
        assert [c["chosen"] for c in document["cameras"] if c["driver"] == "v4l2"] == [True], text
    for text, said in (('device = "/dev/video7";', "not among"), ('device = "usb:ffff:ffff";', "not among"),
                       ('format = "MJPG";', "YUYV"), ('format = "YUYV"; width = 1920; height = 1080;', "1920 x 1080")):
        code, document = doctor(program, folder, text)
        (problem,) = of(document, "problem")
        assert code == 1 and said in problem["what"] and problem["advice"], (text, problem)


def main():
    program, simulated = sys.argv[1:3]
    folder = "/run/doctor"
    os.makedirs(folder)
    subprocess.run(["modprobe", "-a", "vhci-hcd", "uvcvideo"], check=True)
    camera = subprocess.Popen([simulated, "-w", "640", "-h", "480"])
    start = time.monotonic()
    while not os.path.exists("/dev/video0"):
        assert time.monotonic() - start < NODE_WAIT_S
        time.sleep(0.1)
    subprocess.run(["udevadm", "settle"], check=True)
    seen = check_camera(program, folder)
    check_automatic(program, folder)
    check_configurations(program, folder, seen)
    camera.terminate()
    print("found:", seen["name"], seen["device"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
