"""A misbehaving client: bad_client.py ROLE PORT QUESTION.

ROLE: flood (sends requests as fast as possible), unread (never reads answers) or stopped (a signal
stops it in the middle of a request). PORT: path of a terminal or Unix socket, or tcp://HOST:PORT.
QUESTION: hexadecimal bytes.
"""

import os
import select
import signal
import socket
import stat
import sys
import tty

AT_ONCE = 100
PAUSE_MS = 10


def opened(port: str) -> tuple[int, object]:
    if "://" in port:
        host, number = port.split("://")[1].rsplit(":", 1)
        connection = socket.create_connection((host, int(number)))
    elif stat.S_ISSOCK(os.stat(port).st_mode):
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        connection.connect(port)
    else:
        fd = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(fd)
        return fd, None
    connection.setblocking(False)
    return connection.fileno(), connection


def main(role: str, port: str, question: bytes) -> None:
    """Runs until the port hangs up."""
    fd, _kept = opened(port)
    if role == "stopped":
        os.write(fd, question[: len(question) // 2])
        os.kill(os.getpid(), signal.SIGSTOP)
    reads = select.POLLIN if role == "flood" else 0
    poller = select.poll()
    poller.register(fd, select.POLLOUT | reads)
    rest = b""
    while True:
        events = poller.poll()[0][1]
        if events & select.POLLIN and not os.read(fd, 1 << 16):
            return
        if events & select.POLLOUT:
            rest = rest or question * AT_ONCE
            rest = rest[os.write(fd, rest) :]
        if role == "unread":
            select.select([], [], [], PAUSE_MS / 1000)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], bytes.fromhex(sys.argv[3]))
