"""Every format of the kernel's own test camera (vivid): its colour bars come out as the colours that they are, in every
encoding, and random pictures that are put into its loop come out bit by bit.

    guest_vivid.py PROBE"""
import os
import subprocess
import sys
import time

import numpy as np

from guest import Probe, run, wait_until

CAMERA, OUTPUT = "/dev/video0", "/dev/video1"
# White, yellow, cyan, green, magenta, red, blue, black.
BARS = np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1], [0, 1, 0], [1, 0, 1], [1, 0, 0], [0, 0, 1], [0, 0, 0]], float)
NOT_READ = {"HSV3", "HSV4"}  # hue and saturation: no camera sends them
LUMA = np.array([0.2126, 0.7152, 0.0722])  # vivid's grey: over the whole range


def control(node, **values):
    run("v4l2-ctl", "-d", node, "--set-ctrl", ",".join(f"{k}={v}" for k, v in values.items()))


def bars_of(frame, width):
    """The middle of every bar, all rows: (8, channels) and the largest deviation within a bar."""
    eighth = width / 8
    parts = [frame[:, int((k + 0.3) * eighth):int((k + 0.7) * eighth)].astype(float) for k in range(8)]
    values = np.array([p.mean(axis=(0, 1)) for p in parts])
    return values, max(np.abs(p - v).max() for p, v in zip(parts, values))


# vivid reckons with integers that it truncates, twice: a code and a half of brightness and of a colour difference.
TRUNCATED = 1.5 / 219 + 1.772 * 1.5 / 224


def tolerance(name, depth, differences):
    """Of full scale: what vivid and the format itself lose. Fields of few bits are truncated to them, and colour
    differences count up to 1.772 times."""
    step = 1 / 2 ** min(depth, 8)
    return (TRUNCATED if depth >= 8 else 0.5 * TRUNCATED + 2.772 * step) if differences else 1.01 * step


def bars_in_every_format(probe, offers):
    worst = {}
    for name, offer in offers.items():
        if name in NOT_READ:
            assert not offer["decoded"] and probe.open(CAMERA, name)["status"] == "bad-input"
            continue
        assert offer["decoded"], f"{name} is not read"
        info = probe.must_open(CAMERA, name.replace(" ", "_"), 320, 180, 60)
        frame, _ = probe.frame()
        values, spread = bars_of(frame, info["width"])
        full = 2 ** info["bits"] - 1
        if info["channels"] == 1:
            # 8 bits, moved up to the format's depth.
            wanted = (BARS @ LUMA * 255 * 2 ** (info["bits"] - 8))[:, None]
            error = np.abs(values - wanted).max() / (full + 1)
        else:
            error = np.abs(values / full - BARS).max()
        allowed = tolerance(name, offer["depth"], name == "422P" or ("Y" in name or "V" in name) and name != "BYR2")
        worst[name] = error
        assert error <= allowed, f"{name}: {error:.4f} of full scale off, allowed {allowed:.4f}:\n{values}"
        assert spread <= full * 0.012, f"{name}: bars vary by {spread} of {full}"
        probe.close()
    print(f"{len(worst)} formats; worst error of a colour bar {max(worst.values()):.4f} ({max(worst, key=worst.get)})")


def bars_in_every_encoding(probe):
    """Whatever the matrix and the range, colours stay what they are; constant luminance is refused."""
    encodings = {1: "601", 2: "709", 3: "XV601", 4: "XV709", 6: "BT.2020", 7: "constant luminance", 8: "SMPTE 240M"}
    worst = 0.0
    for encoding, title in encodings.items():
        for quantization in (1, 2):
            control(CAMERA, y_cbcr_encoding=encoding, quantization=quantization)
            for name in ("YUYV", "NV24", "RGB3"):
                answer = probe.open(CAMERA, name, 320, 180, 60)
                if title == "constant luminance" and name != "RGB3":
                    assert answer["status"] == "bad-input" and "constant" in answer["message"], answer
                    continue
                assert answer["status"] == "ok", answer
                values, _ = bars_of(probe.frame()[0], 320)
                error = np.abs(values / (2 ** answer["bits"] - 1) - BARS).max()
                worst = max(worst, error)
                assert error <= TRUNCATED, f"{name}, {title}, range {quantization}: {error:.4f} off:\n{values}"
                probe.close()
    control(CAMERA, y_cbcr_encoding=0, quantization=0)
    print(f"encodings: worst error of a colour bar {worst:.4f}")


def rgb_of(y, cb, cr, limited):
    """BT.601 as the kernel's documentation has it, to 10 bits."""
    y = (y - 16) / 219 if limited else y / 255
    pb, pr = ((c - 128) / (224 if limited else 255) for c in (cb, cr))
    rgb = np.stack([y + 1.402 * pr, y - 0.114 * 1.772 / 0.587 * pb - 0.299 * 1.402 / 0.587 * pr, y + 1.772 * pb], -1)
    return np.clip(rgb, 0, 1) * 1023


def pictures(width, height, random):
    """Formats with random bytes and what these mean: (bytes, samples, tolerance)."""
    def noise(*shape):
        return random.integers(0, 256, shape, dtype=np.uint8)

    rgb = noise(height, width, 3)
    yield "RGB3", rgb.tobytes(), rgb.astype(float), 0
    yield "BGR3", rgb[..., ::-1].tobytes(), rgb.astype(float), 0
    grey = noise(height, width)
    yield "GREY", grey.tobytes(), grey[..., None].astype(float), 0
    deep = random.integers(0, 4096, (height, width), dtype=np.uint16)
    yield "Y12 ", deep.tobytes(), deep[..., None].astype(float), 0
    pairs = noise(height, width // 2, 4)
    y = pairs[..., [0, 2]].reshape(height, width).astype(float)
    cb, cr = (np.repeat(pairs[..., k], 2, axis=1).astype(float) for k in (1, 3))
    yield "YUYV", pairs.tobytes(), rgb_of(y, cb, cr, True), 0.51
    y, chroma = noise(height, width), noise(height // 2, width // 2, 2)
    cb, cr = (np.repeat(np.repeat(chroma[..., k], 2, 0), 2, 1).astype(float) for k in (0, 1))
    yield "NV12", y.tobytes() + chroma.tobytes(), rgb_of(y.astype(float), cb, cr, True), 0.51


def play(path):
    """A program that puts the picture into the output again and again. It has begun when it has shown more ">" than it
    has buffers."""
    player = subprocess.Popen(["v4l2-ctl", "-d", OUTPUT, "--stream-out-mmap", f"--stream-from={path}", "--stream-loop"],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    seen = b""
    while seen.count(b">") < 10:
        byte = player.stdout.read(1)
        assert byte, seen
        seen += byte
    return player


def loop_is_exact(probe):
    for node, option in ((OUTPUT, "--set-dv-bt-timings=index=0"), (CAMERA, "--set-dv-bt-timings=index=0")):
        run("v4l2-ctl", "-d", node, option)
    control(CAMERA, osd_text_mode=2, loop_video=1)
    width, height = 640, 480
    for code, raw, wanted, allowed in pictures(width, height, np.random.default_rng(int(time.time()))):
        path = os.path.join(os.path.dirname(probe.file), "out.raw")
        with open(path, "wb") as out:
            out.write(raw)
        run("v4l2-ctl", "-d", OUTPUT, f"--set-fmt-video-out=pixelformat={code}")
        # The camera is opened last: its priority then keeps others from starting any of vivid's streams.
        player = play(path)
        info = probe.must_open(CAMERA, code.replace(" ", "_"), width, height)
        start = time.monotonic()
        error = np.inf
        while error > allowed and time.monotonic() - start < 5:
            frame, _ = probe.frame()
            error = np.abs(frame - wanted).max()
        player.terminate()
        player.wait()
        probe.close()
        assert error <= allowed, f"{code}: {error} codes off, of {info['bits']} bits"
        print(f"{code}: {wanted.size} random samples come out as they went in ({error:.2f} codes)")


# vivid's buttons.
DISCONNECT, DAMAGED_PICTURE, BROKEN_STREAM = 0x00f0f041, 0x00f0f042, 0x00f0f046


def faults_are_survived(probe):
    """A damaged picture is left out, a broken stream is started anew, and a camera that went is opened again."""
    probe.must_open(CAMERA, "RGB3", 320, 180, 60)
    _, before = probe.frame()
    for button in (DAMAGED_PICTURE, BROKEN_STREAM):
        assert probe.ask(f"press {button}")["status"] == "ok"
        _, after = probe.frame(before["exposed_ns"] + 1)
        assert after["sequence"] > before["sequence"], (button, before, after)
        before = after
    # vivid is there again as soon as it was closed.
    probe.ask(f"press {DISCONNECT}")
    _, after = probe.frame(before["exposed_ns"] + 1)
    assert after["sequence"] > before["sequence"], (before, after)
    probe.close()
    print("damaged picture left out, broken stream started anew, camera opened again that was gone")


def main():
    run("modprobe", "vivid", "n_devs=1", "node_types=0x101", "num_inputs=2", "input_types=0xc", "num_outputs=1",
        "output_types=0x1", "vid_cap_nr=0", "vid_out_nr=1")
    wait_until(lambda: os.path.exists(CAMERA) and os.path.exists(OUTPUT), "vivid has its nodes")
    control(CAMERA, test_pattern=1, osd_text_mode=2)
    probe = Probe(sys.argv[1])
    answer = probe.ask("list")
    assert [c["node"] for c in answer["cameras"]] == [CAMERA], answer
    bars_in_every_format(probe, answer["cameras"][0]["offers"])
    bars_in_every_encoding(probe)
    run("v4l2-ctl", "-d", CAMERA, "--set-input=1")
    loop_is_exact(probe)
    run("v4l2-ctl", "-d", CAMERA, "--set-input=0")
    faults_are_survived(probe)
    probe.end()


if __name__ == "__main__":
    main()
