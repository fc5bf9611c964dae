"""Asks the daemon as whoever runs this. SOCKET and a JSON list of [kind, path]; prints a reply a line."""
import array
import json
import os
import socket
import sys
import tempfile


def opened(kind, path):
    """The descriptor to pass, or None."""
    if kind == "fd":
        return os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    if kind == "o_path":
        return os.open(path, os.O_PATH)
    if kind == "socket":
        return socket.socketpair()[0].detach()
    if kind == "write_only":
        return os.open(tempfile.gettempdir(), os.O_TMPFILE | os.O_WRONLY, 0o600)
    return None


def ask(kind, path):
    try:
        to = socket.socket(socket.AF_UNIX)
        to.connect(sys.argv[1])
        descriptor = opened(kind, path)
    except OSError as problem:
        return {"error": problem.strerror}
    method = kind if kind == "reacquire" else "show"
    params = {} if kind == "reacquire" else {"path": path or "nameless"}
    request = json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode() + b"\n"
    rights = [] if descriptor is None else [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [descriptor]))]
    try:
        to.sendmsg([request], rights)
    except BrokenPipeError:
        pass  # it was turned away; why can still be read
    return json.loads(to.makefile().readline())


for kind, path in json.loads(sys.argv[2]):
    print(json.dumps(ask(kind, path)))
