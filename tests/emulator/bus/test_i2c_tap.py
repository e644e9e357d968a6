"""A bus in front of another one has its targets and carries its transfers."""

from cubestack.emulator.bus.i2c import I2cBus, I2cMessage
from cubestack.emulator.bus.i2c_tap import BusTap
from cubestack.emulator.sim.virtual_time import Kernel


class Target:
    def __init__(self) -> None:
        self.written = bytearray()

    def i2c_start(self, read: bool) -> None:
        pass

    def i2c_write(self, byte: int) -> bool:
        self.written.append(byte)
        return True

    def i2c_read(self) -> int:
        return 7

    def i2c_stop(self) -> None:
        pass


def test_tap_is_the_bus_behind_it():
    kernel, target = Kernel(), Target()
    bus = I2cBus(kernel, hz=400_000)
    tap = BusTap(bus)
    tap.attach(0x19, target)
    tap.move(0x19, 0x1A)
    assert tap.targets == bus.targets
    assert tap.bit_ps == bus.bit_ps
    read = I2cMessage(0x1A, read=2)
    kernel.run(kernel.process(tap.transfer([I2cMessage(0x1A, bytearray(b"ab")), read])))
    assert (target.written, read.data) == (b"ab", b"\7\7")
