"""Sixteen clients of a daemon that ask for its status, a thousand times a second in all, and one that never reads.
Reads "quiet" or "loud" from stdin and prints how many answers came since the last such line."""
import selectors
import socket
import sys
import time

CLIENTS, RATE = 16, 1000
REQUEST = b'{"jsonrpc":"2.0","id":1,"method":"status"}\n'


def connect():
    made = socket.socket(socket.AF_UNIX)
    made.connect(sys.argv[1])
    made.setblocking(False)
    return made


def stuff(deaf):
    """Goes on asking without reading; connects anew where the daemon hung up."""
    try:
        deaf.send(REQUEST.replace(b"status", b"subscribe") + REQUEST * 120)
    except BlockingIOError:
        pass
    except OSError:
        deaf.close()
        return connect()
    return deaf


def main():
    crowd, deaf = [connect() for _ in range(CLIENTS)], connect()
    chosen = selectors.DefaultSelector()
    for one in [*crowd, sys.stdin]:
        chosen.register(one, selectors.EVENT_READ)
    loud, began, sent, answers = False, 0.0, 0, 0
    while True:
        for key, _ in chosen.select(0.002 if loud else None):
            if key.fileobj is not sys.stdin:
                answers += key.fileobj.recv(1 << 16).count(b"\n")
                continue
            line = sys.stdin.readline()
            if not line:
                return
            print(answers, flush=True)
            loud, began, sent, answers = line == "loud\n", time.monotonic(), 0, 0
        while loud and sent < RATE * (time.monotonic() - began):
            crowd[sent % CLIENTS].send(REQUEST)
            sent += 1
            if sent % 50 == 0:
                deaf = stuff(deaf)


main()
