"""Adafruit Blinka's bus on Linux, without a known board."""

import errno
import sys

from adafruit_blinka.microcontroller.generic_linux.i2c import I2C

bus = I2C(int(sys.argv[1].removeprefix("/dev/i2c-")), mode=I2C.MASTER)
data, byte = bytearray(4), bytearray(1)
bus.writeto_then_readfrom(0x1A, b"\x80", data)
bus.writeto_then_readfrom(0x1A, b"\x83", byte)
print(data.hex(), byte.hex(), end=" ")
try:
    bus.writeto_then_readfrom(0x33, b"\x83", byte)
except OSError as error:
    print("absent" if error.errno == errno.ENXIO else error)
