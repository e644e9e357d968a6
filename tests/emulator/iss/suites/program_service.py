"""Runs programs on the bare part for DejaGnu: a forked process each, as start-up takes longest.

``python -m tests.emulator.iss.suites.program_service SOCKET PROGRAM`` runs PROGRAM, which loads
what runs need, then serves. DejaGnu calls `program_client.py`.
"""

import os
import resource
import signal
import socket
import sys
from pathlib import Path

import cubestack

TIMEOUT_S = 1000
"""Of virtual time: strcmp-1 of newlib takes 80 s at the 14 MHz that the part starts with."""

PROCESSOR_S = 250
TIMED_OUT = 124

TEMPORARY = "/tmp"
"""Where newlib's tmpnam places files."""


def run(program: str) -> int:
    """Run an ELF file until it exits; prints its output, returns its exit status."""
    options = {"semihosting": True, "semihosting_root": TEMPORARY}
    with cubestack.open_device("efm32gg", firmware=program, **options) as part:
        try:
            ended = part.run_to_exit(TIMEOUT_S)
        except TimeoutError as error:
            print(error)
            return TIMED_OUT
    print(ended.output, end="", flush=True)
    return ended.status & 0xFF


def answer(connection: socket.socket) -> None:
    """Run the program that a client names, on its standard streams."""
    name, streams, _, _ = socket.recv_fds(connection, 4096, 2)
    for number, stream in enumerate(streams, 1):
        os.dup2(stream, number)
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_S, PROCESSOR_S))
    connection.sendall(bytes([run(os.fsdecode(name))]))


def serve(path: Path) -> None:
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))
        server.listen(16)
        while True:
            connection, _ = server.accept()
            with connection:
                if os.fork() == 0:
                    server.close()
                    answer(connection)
                    os._exit(0)


if __name__ == "__main__":
    run(sys.argv[2])
    serve(Path(sys.argv[1]))
