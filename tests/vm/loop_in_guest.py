"""In the guest: calibrates, measures, solves and shows with real drivers, and prints how near what appears is.

    loop_in_guest.py DRIVER COUNTERLIGHT COUNTERLIGHTD CAMERA ROOM"""
import json
import subprocess
import sys
import tempfile

import bench
import station


def main():
    driver, counterlight, counterlightd, camera, room = sys.argv[1:]
    for module in ("vhci-hcd", "uvcvideo"):
        subprocess.run(["modprobe", module], check=True)
    with tempfile.TemporaryDirectory() as name, bench.Bench(name, camera, room) as there, \
            station.Station(name, counterlight, counterlightd, bench.devices(driver)) as exhibit:
        exhibit.calibrate()
        exhibit.start()
        exhibit.wait_state("calibrating", "acquiring")
        before = station.error_of(there.radiance())
        status = exhibit.wait_state("showing")
        print(json.dumps({"error": station.error_of(there.radiance()), "before": before,
                          "patterns": status["transport"]["patterns"]}))


if __name__ == "__main__":
    main()
