"""In the guest: calibrates, measures, solves and shows with real drivers, one after the other, and prints how near what
appears is; with Video4Linux the camera fails in between.

    loop_in_guest.py DRIVERS COUNTERLIGHT COUNTERLIGHTD CAMERA ROOM"""
import json
import pathlib
import subprocess
import sys
import tempfile

import bench
import faults
import station
import usb_host


def close(driver, there, exhibit):
    """The loop, once."""
    exhibit.calibrate()
    exhibit.start()
    exhibit.wait_state("calibrating", "acquiring")
    before = station.error_of(there.radiance())
    status = exhibit.wait_state("showing")
    print(json.dumps({"driver": driver, "error": station.error_of(there.radiance()), "before": before,
                      "patterns": status["transport"]["patterns"]}), flush=True)


def main():
    drivers, counterlight, counterlightd, camera, room = sys.argv[1:]
    subprocess.run(["modprobe", "-a", "vhci-hcd", "uvcvideo"], check=True)
    usb_host.give_firmware_node()
    with tempfile.TemporaryDirectory() as name, bench.Bench(name, camera, room) as there:
        for driver in drivers.split(","):
            folder = pathlib.Path(name, driver)
            folder.mkdir()
            with station.Station(folder, counterlight, counterlightd, bench.devices(driver)) as exhibit:
                close(driver, there, exhibit)
                if driver == "v4l2":
                    print(json.dumps(faults.check(there, exhibit)), flush=True)


if __name__ == "__main__":
    main()
