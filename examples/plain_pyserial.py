"""Attitude of a CubeStar with nothing but pyserial: python plain_pyserial.py /dev/ttyUSB0."""

import struct
import sys
import time

import serial

if len(sys.argv) != 2:
    sys.exit("usage: python plain_pyserial.py PORT")

port = serial.serial_for_url(sys.argv[1], baudrate=57600, timeout=2)


def request(identifier: int, length: int) -> bytes:
    """Send a frame with this ID and return the data of the answer."""
    port.write(bytes([0x1F, 0x7F, identifier, 0x1F, 0xFF]))
    answer = port.read(2)  # 1F 7F
    while len(answer) < 2 + length:
        byte = port.read(1) or sys.exit(f"no answer to {identifier}")
        answer += byte
        if byte == b"\x1f":  # a 1F in the data is doubled
            port.read(1)
    port.read(2)  # 1F FF
    return answer[2:]


if request(36, 1) != b"\0":
    sys.exit("CaptureAndProcess was rejected")
while request(131, 1) != b"\1":  # TcmdProcessed
    time.sleep(0.1)
if request(132, 1) != b"\x1d":  # TaskStatus: calculated
    sys.exit("no attitude in this image")
x, y, z, w, ra, dec, *boresight = (raw / 10000 for raw in struct.unpack("<9h", request(177, 18)))
print(f"quaternion {x:+.4f} {y:+.4f} {z:+.4f} {w:+.4f}")
print(f"right ascension {ra:+.4f} rad, declination {dec:+.4f} rad")
