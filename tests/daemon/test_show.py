"""From the start to showing, what the status says, other pictures, snapshots, holding."""
import json
import os
import subprocess

import h5py
import numpy

from exhibit import SOURCE, exhibit, main


def drive(run):
    return numpy.load(run.state / "drive.npy")


def reaches_showing_and_says_how_well():
    with exhibit() as run:
        run.start()
        status = run.wait_state("showing")
        assert status["transport"]["grid"] == {"width": 16, "height": 12, "channels": 3}, status
        assert status["transport"]["patterns"] >= 16 * 12
        assert 0 <= status["transport"]["error"] < 0.05
        frame = status["frame"]
        assert frame["compensated"] and frame["method"] and frame["solve_ms"] > 0
        assert 0 < frame["error"] < frame["error_before"], frame
        assert frame["fps"] > 0 and frame["late"] >= 0
        assert "% error costs" in status["cost"] and "acquisition's own error" in status["cost"], status["cost"]
        assert status["devices"]["projector"] == status["devices"]["camera"] == "simulated"
        assert status["progress"] is None and status["why"] is None
        assert status["content"].endswith("moon.png")
        assert status["since"].endswith("Z") and status["transport"]["acquired"].endswith("Z")
        # The stored pair really is a solution: recomputed in double from the files alone.
        with h5py.File(run.state / "transport.h5") as file:
            dense, black = file["dense"][:].astype(float), file["black"][:].astype(float)
        x = drive(run).astype(float).reshape(3, -1)
        assert x.min() >= 0 and x.max() <= 1
        seen = black + numpy.einsum("cij,cj->ci", dense, x)
        with run.client() as client:
            target = read_png(client.ask("snapshot")["target"])
        white = numpy.array([numpy.median(numpy.diag(d)) for d in dense])
        wanted = target.reshape(3, -1) * white[:, None]
        error = numpy.linalg.norm(seen - wanted) / numpy.linalg.norm(wanted)
        assert abs(error - frame["error"]) < 0.02, (error, frame["error"])


def read_png(path):
    """An 8-bit PNG as linear light [channels, height, width], by the standard library alone."""
    import struct
    import zlib
    data, at, packed = open(path, "rb").read(), 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height, bits, colour = struct.unpack(">IIBB", body[:10])
            assert bits == 8 and colour in (0, 2)
        packed += body if kind == b"IDAT" else b""
        at += 12 + length
    channels = 3 if colour == 2 else 1
    raw = numpy.frombuffer(zlib.decompress(packed), numpy.uint8).reshape(height, -1).astype(int)
    rows = numpy.zeros((height, width * channels), int)
    for y in range(height):
        rows[y] = unfilter(raw[y, 0], raw[y, 1:], rows[y - 1] if y else 0 * rows[0], channels)
    code = rows.reshape(height, width, channels).transpose(2, 0, 1) / 255
    return numpy.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def unfilter(kind, row, above, step):
    out = numpy.zeros_like(row)
    for i, value in enumerate(row):
        left, up, corner = (out[i - step], above[i], above[i - step]) if i >= step else (0, above[i], 0)
        guess = left + up - corner
        paeth = min((left, up, corner), key=lambda v: abs(guess - v))
        out[i] = (value + (0, left, up, (left + up) // 2, paeth)[kind]) % 256
    return out


def tells_what_accuracy_costs():
    with exhibit() as run:
        run.start()
        with run.client() as client:
            early = client.call("tradeoff")
            assert "error" not in early or early["error"]["code"] == -32000, early
            run.wait_state("showing")
            found = client.ask("tradeoff")
            assert found["grid"] == {"width": 16, "height": 12, "channels": 3}
            front = found["front"]
            assert front and found["sentence"] and found["chosen"]["method"], found
            times, errors = [p["time_ms"] for p in front], [p["error"] for p in front]
            assert times == sorted(times) and errors == sorted(errors, reverse=True), front
            for point in front:
                parts = [point["solver_error"], point["storage_error"], point["clipping_error"]]
                assert 2 * max(parts) - sum(parts) - 1e-9 <= point["error"] <= sum(parts) + 1e-9, point
            assert found["chosen"]["error"] in errors
            assert found["sentence"] in client.ask("status")["cost"]
            assert client.refused("tradeoff", size=3)["code"] == -32602
            assert len(json.dumps(client.call("tradeoff"))) < 65536
            # another picture has other costs; who asks meanwhile waits, and no request waits for the measurement
            other = run.folder / "other.npy"
            numpy.save(other, numpy.full((3, 12, 16), 0.4, numpy.float32))
            for k in range(3):
                client.ask("show", path=str(other if k % 2 == 0 else run.content))
            client.ask("subscribe")
            if client.ask("status")["state"] != "showing":
                client.until("showing")
            again = client.ask("tradeoff")
            assert again["limit"] <= run.status()["frame"]["error"] + 1e-6
        code, seconds = run.stop()
        assert code == 0 and seconds < 3


def a_stored_transport_is_used_at_once():
    with exhibit() as run:
        run.start()
        first = run.wait_state("showing")
        before = (run.state / "transport.h5").read_bytes()
        run.stop()
        run.start()
        with run.client() as client:
            client.ask("subscribe")
            states = {run.wait_state("showing")["state"]}
            states |= {n["params"]["state"] for n in client.notifications}
        second = run.status()
        assert second["transport"] == first["transport"]
        assert "acquiring" not in states
        assert (run.state / "transport.h5").read_bytes() == before


def another_picture_is_shown_and_survives_a_restart():
    with exhibit() as run:
        other = run.folder / "other.npy"
        numpy.save(other, numpy.random.default_rng(1).random((3, 12, 16)).astype(numpy.float32) * 0.3)
        run.start()
        run.wait_state("showing")
        first = drive(run)
        with run.client() as client, open(other, "rb") as file:
            client.ask("subscribe")
            assert client.ask("show", descriptor=file.fileno(), path="/a/name.npy")["content"] == "/a/name.npy"
            client.until("showing")
            second = drive(run)
            assert not numpy.allclose(first, second)
            assert client.ask("show", path=str(run.content))["content"] == str(run.content)
            client.until("showing")
            assert numpy.allclose(drive(run), first, atol=1e-3)
            client.ask("show", path=str(other))
            client.until("showing")
        other.unlink()
        run.stop()
        run.start()
        assert run.wait_state("showing")["content"] == str(other)
        assert numpy.allclose(drive(run), second, atol=1e-3)
        # Another content in the configuration wins over what was shown before.
        run.stop()
        copy = run.folder / "copy.png"
        copy.write_bytes(run.content.read_bytes())
        run.write_config(content=copy)
        run.start()
        assert run.wait_state("showing")["content"] == str(copy)
        assert numpy.allclose(drive(run), first, atol=1e-3)


def what_is_no_picture_is_refused_and_nothing_changes():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        before = drive(run)
        text, damaged = run.folder / "text.png", run.folder / "damaged.png"
        text.write_text("no picture at all")
        damaged.write_bytes(run.content.read_bytes()[:900])
        with run.client() as client:
            for path in (text, damaged):
                with open(path, "rb") as file:
                    error = client.refused("show", descriptor=file.fileno(), path=str(path))
                assert error["code"] == -32602 and str(path) in error["message"], error
            assert client.refused("show")["code"] == -32602
            assert client.refused("show", path="relative.png")["code"] == -32000
            assert client.refused("show", path="/no/such/file.png")["code"] == -32000
            assert client.refused("show", path="/dev/zero")["code"] == -32602
            reader, writer = os.pipe()
            assert client.refused("show", descriptor=reader)["code"] == -32602
            os.close(reader), os.close(writer)
            assert client.refused("show", size=3)["code"] == -32602
            assert client.ask("status")["state"] == "showing"
        assert (drive(run) == before).all()
        assert not list(run.state.glob(".new-*"))


def a_snapshot_photographs_what_is_up():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        with run.client() as one, run.client() as two:
            text = b'{"jsonrpc":"2.0","id":9,"method":"snapshot"}\n'
            one.send(text), two.send(text)
            paths = one.line()["result"]
            assert two.line()["result"] == paths
        target, seen = read_png(paths["target"]), read_png(paths["observation"])
        status = run.wait_state("showing")
        error = numpy.linalg.norm(seen - target) / numpy.linalg.norm(target)
        assert error < 0.2, error
        assert 0 < status["frame"]["verified_error"] < 0.2, status
        codes = read_png(paths["drive"])
        assert abs(codes - drive(run)).max() < 0.02  # the panel's response is sRGB, as a PNG's


def hold_keeps_the_picture_and_resume_goes_on():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        with run.client() as client:
            assert client.refused("resume")["message"] == "cannot resume while showing"
            assert client.ask("hold")["state"] == "holding"
            before = run.status()["frame"]["presented"]
            while run.status()["frame"]["presented"] < before + 5:
                pass  # the picture goes on being shown
            assert client.ask("status")["why"] == "asked to hold"
            client.ask("resume")
        assert run.wait_state("showing")["why"] is None


def holds_and_retries_where_the_rig_cannot_work():
    with exhibit() as run:
        run.write_config(station="rig = { exposures_ms = [50000]; };")
        run.start()
        status = run.wait_state("holding")
        assert "exposure" in status["why"], status
        while not run.status()["frame"]["presented"]:
            pass  # the uncompensated picture is up all the same
        status = run.status()
        assert status["transport"] is None and not status["frame"]["compensated"]
        assert "not compensated" in status["cost"]
        code, seconds = run.stop()
        assert code == 0 and seconds < 2


def checks_what_it_is_given():
    with exhibit() as run:
        code, said = run.run("--check")
        assert code == 0 and "OK" in said, said
        for change, wanted in (({"daemon": "verify_minuets = 1;"}, ":8: verify_minuets: is not a known key"),
                               ({"daemon": "tolerance = 7;"}, ":8: tolerance: is 7; legal is"),
                               ({"daemon": "retry_s = [5, 1];"}, "retry_s"),
                               ({"daemon": 'method = "magic";'}, 'legal is "auto"'),
                               ({"daemon": 'white = "-3";'}, "white"),
                               ({"daemon": 'at_start = "sleep";'}, "at_start"),
                               ({"station": "rig = { width = 0; };"}, "width"),
                               ({"station": "surprise = 1;"}, "surprise"),
                               ({"content": "/no/such/picture.png"}, "/no/such/picture.png")):
            run.write_config(**change)
            code, said = run.run("--check")
            assert code == 2 and wanted in said, (change, code, said)
            if "content" not in change:
                assert str(run.config) in said, said
            code, said = run.run()
            assert code == 2 and wanted in said, (change, code, said)
        run.write_config()
        run.write_scene(5000, 12)
        code, said = run.run("--check")
        assert code == 2 and "room.cfg:2: width: is 5000; legal is" in said, said
        assert subprocess.run([run.program], capture_output=True).returncode == 2
        assert subprocess.run([run.program, "--config", "x", "y"], capture_output=True).returncode == 2
        assert subprocess.run([run.program, "--config", "/no/file"], capture_output=True).returncode == 2
        assert b"counterlightd" in subprocess.run([run.program, "--version"], capture_output=True).stdout
        shipped = SOURCE / "config" / "simulated.cfg"
        assert subprocess.run([run.program, "--config", shipped, "--check"], capture_output=True).returncode == 0


if __name__ == "__main__":
    main([reaches_showing_and_says_how_well, tells_what_accuracy_costs, a_stored_transport_is_used_at_once,
          another_picture_is_shown_and_survives_a_restart, what_is_no_picture_is_refused_and_nothing_changes,
          a_snapshot_photographs_what_is_up, hold_keeps_the_picture_and_resume_goes_on,
          holds_and_retries_where_the_rig_cannot_work, checks_what_it_is_given])
