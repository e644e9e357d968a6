"""python-periphery."""

import errno
import sys

from periphery import I2C, I2CError

bus = I2C(sys.argv[1])


def read(address: int, register: int, count: int) -> str:
    messages = [I2C.Message([register]), I2C.Message([0] * count, read=True)]
    bus.transfer(address, messages)
    return bytes(messages[1].data).hex()


print(read(0x1A, 0x80, 4), read(0x1A, 0x83, 1), end=" ")
try:
    read(0x33, 0x83, 1)
except I2CError as error:
    print("absent" if error.errno == errno.ENXIO else error)
bus.close()
