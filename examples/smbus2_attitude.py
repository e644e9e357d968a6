"""Attitude of a CubeStar over I2C with nothing but smbus2: python smbus2_attitude.py 7.

On an emulated bus: cubestack run -- python smbus2_attitude.py 7
"""

import struct
import sys
import time

from smbus2 import SMBus, i2c_msg

ADDRESS = 0x1A


def telemetry(bus: SMBus, identifier: int, length: int) -> bytes:
    """Write the ID, repeated start, read the data."""
    answer = i2c_msg.read(ADDRESS, length)
    bus.i2c_rdwr(i2c_msg.write(ADDRESS, [identifier]), answer)
    return bytes(answer)


if len(sys.argv) != 2:
    sys.exit("usage: python smbus2_attitude.py BUS")

with SMBus(int(sys.argv[1])) as bus:
    bus.write_byte(ADDRESS, 36)  # CaptureAndProcess
    while telemetry(bus, 131, 1) != b"\1":  # TcmdProcessed
        time.sleep(0.05)
    if telemetry(bus, 132, 1) != b"\x1d":  # TaskStatus: calculated
        sys.exit("no attitude in this image")
    x, y, z, w = (raw / 10000 for raw in struct.unpack("<4h", telemetry(bus, 177, 18)[:8]))
    print(f"{x:+.4f} {y:+.4f} {z:+.4f} {w:+.4f}")
