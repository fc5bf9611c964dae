"""A counterlightd of its own for a test: its configuration, its folder, its socket, and a small client."""
import array
import contextlib
import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time

SOURCE = pathlib.Path(__file__).resolve().parents[2]
PATIENCE = 60 * float(os.environ.get("CLT_TEST_PATIENCE", "1"))

SCENE = """
grid = {{ width = {width}; height = {height}; channels = {channels}; }};
projector = {{ position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.44, 0.33]; intensity = 40.0; }};
materials = ( {{ name = "white"; albedo = 0.7; }} );
surfaces = (
  {{ corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "white"; }},
  {{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = "white"; }}
);
"""

CONFIG = """
scene = "{scene}";
acquire = {{ scheme = "brute"; }};
{station}
daemon = {{
  content = "{content}";
  group = "";
  {daemon}
}};
"""


def wait_for(what, check, timeout=PATIENCE, pause=0.01):
    """Polls until check() gives something true, and returns that."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        got = check()
        if got:
            return got
        time.sleep(pause)
    raise AssertionError(f"{what} did not come within {timeout} s")


class Client:
    """One connection to the control socket."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(PATIENCE)
        self.socket.connect(str(path))
        self.pending = b""
        self.notifications = []
        self.count = 0

    def close(self):
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def send(self, data):
        self.socket.sendall(data)

    def line(self):
        """The next line, parsed; None at the end of the stream."""
        while b"\n" not in self.pending:
            try:
                more = self.socket.recv(1 << 16)
            except ConnectionResetError:
                more = b""
            if not more:
                return None
            self.pending += more
        line, self.pending = self.pending.split(b"\n", 1)
        return json.loads(line)

    def call(self, method, descriptor=None, **params):
        """The reply's document; notifications that come first are kept."""
        self.count += 1
        request = {"jsonrpc": "2.0", "id": self.count, "method": method}
        if params:
            request["params"] = params
        text = json.dumps(request).encode() + b"\n"
        if descriptor is None:
            self.send(text)
        else:
            self.socket.sendmsg([text], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [descriptor]))])
        while True:
            document = self.line()
            assert document is not None, "the daemon hung up"
            if "id" in document:
                assert document["id"] == self.count, document
                return document
            self.notifications.append(document)

    def ask(self, method, descriptor=None, **params):
        """The result; fails where the daemon refuses."""
        document = self.call(method, descriptor, **params)
        assert "result" in document, document
        return document["result"]

    def refused(self, method, descriptor=None, **params):
        """The error; fails where the daemon does not refuse."""
        document = self.call(method, descriptor, **params)
        assert "error" in document, document
        return document["error"]

    def next(self):
        """The next notification."""
        if self.notifications:
            return self.notifications.pop(0)
        document = self.line()
        assert document is not None, "the daemon hung up"
        assert "method" in document, document
        return document

    def until(self, *states):
        """Notifications up to one that says one of the states."""
        seen = []
        while True:
            seen.append(self.next())
            if seen[-1]["method"] == "state" and seen[-1]["params"]["state"] in states:
                return seen


class Exhibit:
    """A folder with scene, configuration and state, and the daemon that runs on it."""

    def __init__(self, program, folder, width=16, height=12, channels=3):
        self.program = program
        self.folder = pathlib.Path(folder)
        self.socket = self.folder / "c.sock"
        self.state = self.folder / "state"
        self.config = self.folder / "exhibit.cfg"
        self.content = SOURCE / "config" / "pictures" / "moon.png"
        self.process = None
        self.write_scene(width, height, channels)
        self.write_config()

    def write_scene(self, width, height, channels=3):
        (self.folder / "room.cfg").write_text(SCENE.format(width=width, height=height, channels=channels))

    def write_config(self, daemon="retry_s = [0.05, 0.4];", station="", content=None):
        self.config.write_text(CONFIG.format(scene="room.cfg", station=station, daemon=daemon,
                                             content=content or self.content))

    def command(self, *options):
        return [self.program, "--config", str(self.config), "--socket", str(self.socket), "--state", str(self.state),
                *options]

    def start(self, environment=None, **options):
        self.log = open(self.folder / "log", "ab")
        self.process = subprocess.Popen(self.command(), stderr=self.log,
                                        env=dict(os.environ, **(environment or {})), **options)
        return self

    def run(self, *options):
        """Runs the daemon to its end; gives exit code and what it said."""
        done = subprocess.run(self.command(*options), capture_output=True, text=True, timeout=PATIENCE)
        return done.returncode, done.stdout + done.stderr

    def said(self):
        return (self.folder / "log").read_text(errors="replace")

    def client(self):
        def attempt():
            assert self.process is None or self.process.poll() is None, f"the daemon ended:\n{self.said()}"
            try:
                return Client(self.socket)
            except (FileNotFoundError, ConnectionRefusedError, BlockingIOError):
                return None
        return wait_for("the control socket", attempt)

    def status(self):
        with self.client() as client:
            return client.ask("status")

    def process_folder(self):
        return pathlib.Path(f"/proc/{self.process.pid}")

    def wait_state(self, *states):
        """The first status that says one of the states."""
        with self.client() as client:
            def attempt():
                status = client.ask("status")
                return status if status["state"] in states else None
            return wait_for(f"state {'/'.join(states)}", attempt)

    def stop(self, signal=15):
        """Sends the signal; gives the exit code and the seconds it took."""
        began = time.monotonic()
        self.process.send_signal(signal)
        code = self.process.wait(PATIENCE)
        self.process = None
        self.log.close()
        return code, time.monotonic() - began

    def end(self):
        if self.process is not None and self.process.poll() is None:
            self.process.kill()
            self.process.wait()


@contextlib.contextmanager
def exhibit(*arguments, **options):
    """An exhibit in a fresh folder; the log is shown where the test fails."""
    program = os.path.abspath(sys.argv[1])
    folder = tempfile.mkdtemp(prefix="counterlight-daemon-")
    made = Exhibit(program, folder, *arguments, **options)
    try:
        yield made
    except BaseException:
        if (made.folder / "log").exists():
            sys.stderr.write(f"--- the daemon said:\n{made.said()}---\n")
        raise
    finally:
        made.end()
        shutil.rmtree(folder, ignore_errors=True)


def main(tests):
    """Runs the tests (functions), names the failed ones; a test that returns "skip: why" is skipped."""
    wanted = sys.argv[2:]
    failed, skipped, ran = [], 0, 0
    for test in tests:
        if wanted and test.__name__ not in wanted:
            continue
        began = time.monotonic()
        try:
            outcome = test()
        except Exception:  # the next test is independent of this one
            import traceback
            traceback.print_exc()
            failed.append(test.__name__)
            outcome = "FAILED"
        ran += 1
        skipped += str(outcome).startswith("skip")
        print(f"{test.__name__}: {outcome or 'ok'} ({time.monotonic() - began:.1f} s)", flush=True)
    if failed:
        print("failed:", ", ".join(failed))
        sys.exit(1)
    sys.exit(77 if ran and skipped == ran else 0)
