"""Client of an emulated I2C bus: the protocol of docs/reference/i2c-socket.md, version 1.

It needs only Python. As a program it lists the devices on the bus, and reads telemetry 128 of one.
"""

import os
import socket
import struct
import sys

VERSION, HELLO, RDWR = 1, 0, 3
READ = 1


class I2cSocket:
    """A connection to a bus.

    Attributes:
        targets: address of each device by its name.
    """

    def __init__(self, path: str) -> None:
        """Connect to the socket at ``path``; raises OSError with the reason of a refusal."""
        self._link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._link.connect(path)
        data = self._call(HELLO, struct.pack("=I", VERSION))
        pairs = (line.rsplit(" ", 1) for line in data.decode().splitlines())
        self.targets = {name: int(address, 16) for name, address in pairs}

    def transfer(self, address: int, *parts: bytes | int) -> list[bytes]:
        """One transfer: bytes are written, a number of bytes is read; returns what was read.

        Raises OSError: ENXIO if no device has the address, EIO if a byte was not acknowledged.
        """
        body = b""
        for part in parts:
            if isinstance(part, int):
                body += struct.pack("=HHHH", address, READ, part, 0)
            else:
                body += struct.pack("=HHHH", address, 0, len(part), len(part)) + part
        data = self._call(RDWR, body)
        received = []
        for length in (part for part in parts if isinstance(part, int)):
            received.append(data[:length])
            data = data[length:]
        return received

    def close(self) -> None:
        self._link.close()

    def _call(self, call: int, body: bytes) -> bytes:
        data = struct.pack("=QB", 0, call) + body
        self._link.sendall(struct.pack("=I", len(data)) + data)
        (length,) = struct.unpack("=I", self._receive(4))
        reply = self._receive(length)
        (result,) = struct.unpack_from("=i", reply)
        if result < 0:
            raise OSError(-result, reply[4:].decode() or os.strerror(-result))
        return reply[4:]

    def _receive(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            part = self._link.recv(count - len(data))
            if not part:
                raise ConnectionError("the emulation has ended")
            data += part
        return data


def main(path: str, address: str) -> None:
    bus = I2cSocket(path)
    for name, place in bus.targets.items():
        print(f"{name} {place:#04x}")
    (identification,) = bus.transfer(int(address, 0), b"\x80", 4)
    print(*identification)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python i2c_socket.py SOCKET ADDRESS")
    try:
        main(*sys.argv[1:])
    except OSError as error:
        sys.exit(f"i2c_socket.py: {error.strerror or error}")
