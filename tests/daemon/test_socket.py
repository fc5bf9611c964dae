"""The control socket against everything that a client may do wrong, while the picture goes on."""
import json
import os
import random
import socket
import subprocess

from exhibit import exhibit, main, wait_for


def request(method, **more):
    return json.dumps(dict({"jsonrpc": "2.0", "id": 1, "method": method}, **more)).encode() + b"\n"


def malformed_half_and_unknown_requests_are_answered():
    with exhibit() as run:
        run.start()
        with run.client() as client:
            for data, code in ((b"\n", -32700), (b"nonsense\n", -32700), (b'{"a":1\n', -32700), (b"[]\n", -32600),
                               (b"5\n", -32600), (b"{}\n", -32600), (b'{"jsonrpc":"2.0","id":1}\n', -32600),
                               (b'{"jsonrpc":"2.0","id":[],"method":"status"}\n', -32600),
                               (b'{"jsonrpc":"2.0","id":1,"method":"status","params":7}\n', -32602),
                               (b'{"jsonrpc":"2.0","id":1,"method":"status","params":{"x":1}}\n', -32602),
                               (b'{"jsonrpc":"2.0","id":1,"method":"stat\xff"}\n', -32700),
                               (b"\0\0\0\n", -32700), (b"[" * 60000 + b"\n", -32700),
                               (request("trade"), -32601), (request("x" * 5000), -32601)):
                client.send(data)
                reply = client.line()
                assert reply["error"]["code"] == code, (data[:60], reply)
            error = client.refused("no-such-method")
            for name in ("status", "reacquire", "show", "hold", "resume", "snapshot", "reload", "subscribe", "tradeoff"):
                assert name in error["message"], error
            text = request("status")
            for at in range(1, len(text)):
                client.send(text[:at])
                client.send(text[at:])
                assert client.line()["result"]["version"]
            client.send(text * 50)
            for _ in range(50):
                assert client.line()["id"] == 1
            client.send(b'{"jsonrpc":"2.0","method":"status"}\n' + text)  # the first wants no reply
            assert client.line()["id"] == 1
        run.wait_state("showing")


def an_oversized_line_ends_that_connection_only():
    with exhibit() as run:
        run.start()
        with run.client() as other, run.client() as client:
            try:
                client.send(b"x" * 200000)
            except (BrokenPipeError, ConnectionResetError):
                pass
            assert client.line()["error"]["code"] == -32600
            assert client.line() is None
            assert other.ask("status")["state"]
            # 64 KiB to the byte are taken.
            text = request("status")[:-1]
            other.send(text + b" " * (65536 - len(text)) + b"\n")
            assert "result" in other.line()
        with run.client() as half:
            half.send(b'{"jsonrpc":"2.0","id":1,')
        assert run.wait_state("showing")


def a_client_that_never_reads_is_dropped_and_delays_no_frame():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        deaf = socket.socket(socket.AF_UNIX)
        deaf.connect(str(run.socket))
        deaf.setblocking(False)
        def stuffed():
            try:
                deaf.send(request("subscribe") + request("status") * 100)
                return False
            except BlockingIOError:
                return False
            except (BrokenPipeError, ConnectionResetError):
                return True
        before = run.status()["frame"]
        wait_for("the drop", stuffed)
        assert "does not read its answers" in run.said()
        wait_for("more frames", lambda: run.status()["frame"]["presented"] > before["presented"] + 10)
        deaf.close()


def crowds_and_random_clients_do_no_harm():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        crowd = [socket.socket(socket.AF_UNIX) for _ in range(70)]
        for one in crowd:
            one.connect(str(run.socket))
        def refused():
            return "too many clients" in run.said()
        wait_for("the refusal", refused)
        for one in crowd:
            one.close()
        dice = random.Random(4)
        words = [request("status"), request("hold")[:-9], b"\n", b"{", b"\xff", b'"', request("resume"), request("show")]
        for _ in range(60):
            with run.client() as client:
                try:
                    for _ in range(dice.randrange(20)):
                        client.send(dice.choice(words))
                except (BrokenPipeError, ConnectionResetError):
                    pass  # one of the crowd is not gone yet
        def served():
            with run.client() as client:
                return "result" in client.call("status")
        wait_for("service", served)
        code, seconds = run.stop()
        assert code == 0 and seconds < 2


def descriptors_do_not_leak():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        def count():
            return len(os.listdir(f"/proc/{run.process.pid}/fd"))
        run.status()
        before = wait_for("quiet", count)
        for _ in range(20):
            with run.client() as client, open(run.content, "rb") as file:
                client.call("status", descriptor=file.fileno())
                client.call("show", descriptor=file.fileno(), path="moon")
        wait_for("closed descriptors", lambda: count() <= before)


def a_socket_or_state_in_use_is_told_clearly():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        code, said = run.run()
        assert code == 1 and "another counterlightd listens there" in said and str(run.socket) in said, said
        first, run.socket = run.socket, run.folder / "second.sock"
        code, said = run.run()
        assert code == 1 and "another counterlightd uses this state directory" in said, said
        assert not run.socket.exists()
        run.socket = first
        assert run.status()["state"] == "showing"
        run.stop()
        run.socket.write_text("precious")
        code, said = run.run()
        assert code == 1 and "is no socket" in said and run.socket.read_text() == "precious", said
        run.socket = run.folder / ("long" * 30)
        code, said = run.run()
        assert code == 2 and "at most 107 characters" in said, said
        run.socket = "/proc/nowhere/c.sock"
        code, said = run.run()
        assert code == 1 and "cannot be bound" in said, said


def the_socket_is_for_its_group():
    with exhibit() as run:
        run.config.write_text(run.config.read_text().replace('group = ""', 'group = "no-such-group"'))
        run.start()
        run.wait_state("showing")
        assert 'group "no-such-group" does not exist' in run.said()
        assert run.socket.stat().st_mode & 0o777 == 0o660
        if os.getuid() != 0:
            return "skip: only root can become somebody else"
        run.folder.chmod(0o755)
        run.socket.chmod(0o666)  # even where the file would let them in, strangers are refused by their credentials
        ask = ("import contextlib,socket,sys; s = socket.socket(socket.AF_UNIX); s.connect(sys.argv[1])\n"
               "with contextlib.suppress(BrokenPipeError): s.sendall(sys.argv[2].encode() + b'\\n')\n"
               "print(s.makefile().readline())")
        said = subprocess.run(["/usr/bin/python3", "-c", ask, run.socket, request("status")[:-1]], user=65534,
                              group=65534, extra_groups=[], capture_output=True, text=True, check=True).stdout
        assert "not allowed" in said, said
        assert "uid 65534 refused" in run.said()
        run.stop()
        run.config.write_text(run.config.read_text().replace("no-such-group", "daemon"))
        run.start()
        run.wait_state("showing")
        import grp
        number = grp.getgrnam("daemon").gr_gid
        assert run.socket.stat().st_gid == number
        said = subprocess.run(["/usr/bin/python3", "-c", ask, run.socket, request("status")[:-1]], user=65534,
                              group=65534, extra_groups=[number], capture_output=True, text=True, check=True).stdout
        assert '"showing"' in said, said
        # Members of the group pass opened files; paths are not opened for them with the daemon's rights.
        show = request("show", params={"path": "/etc/shadow"})[:-1]
        said = subprocess.run(["/usr/bin/python3", "-c", ask, run.socket, show], user=65534, group=65534,
                              extra_groups=[number], capture_output=True, text=True, check=True).stdout
        assert "pass the opened file" in said, said
        return None


if __name__ == "__main__":
    main([malformed_half_and_unknown_requests_are_answered, an_oversized_line_ends_that_connection_only,
          a_client_that_never_reads_is_dropped_and_delays_no_frame, crowds_and_random_clients_do_no_harm,
          descriptors_do_not_leak, a_socket_or_state_in_use_is_told_clearly, the_socket_is_for_its_group])
