"""smbus2 or smbus3, named by the first argument."""

import errno
import importlib
import sys

module = importlib.import_module(sys.argv[1])
with module.SMBus(sys.argv[2]) as bus:
    write, read = module.i2c_msg.write(0x1A, [0x80]), module.i2c_msg.read(0x1A, 4)
    bus.i2c_rdwr(write, read)
    print(bytes(read).hex(), f"{bus.read_byte_data(0x1A, 0x83):02x}", end=" ")
    try:
        bus.read_byte_data(0x33, 0x83)
    except OSError as error:
        print("absent" if error.errno == errno.ENXIO else error)
