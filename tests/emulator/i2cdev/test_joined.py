"""Boards with kernels of their own on one bus: one order of events, one time."""

import pytest

from cubestack.emulator.bus.i2c import I2cBus, I2cMessage
from cubestack.emulator.i2cdev.joined import JoinedKernel, join_buses
from cubestack.emulator.sim.virtual_time import Kernel


def test_events_happen_in_the_order_of_their_times():
    kernels = [Kernel() for _ in range(3)]
    happened = []
    for number, kernel in enumerate(kernels):
        for time in range(number, 100, 3 + number):
            event = kernel.timeout(time)
            event.callbacks.append(lambda _event, kernel=kernel: happened.append(kernel.now))
    joined = JoinedKernel(kernels)
    joined.advance_to(40)
    assert happened == sorted(happened)
    assert happened[-1] == 39
    assert [kernel.now for kernel in kernels] == [40] * 3
    while joined.horizon() is not None:
        joined.step()
    assert happened == sorted(happened)
    assert joined.now == happened[-1]


def test_without_events():
    joined = JoinedKernel([Kernel(), Kernel()])
    assert joined.horizon() is None
    joined.advance_to(7)
    assert joined.now == 7


@pytest.fixture
def pair(registers):
    """Two buses, with a target on the second one that writes down its kernel's time."""
    kernels = Kernel(), Kernel()
    buses = I2cBus(kernels[0]), I2cBus(kernels[1])
    times: list[int] = []
    plain = registers.i2c_write
    registers.i2c_write = lambda byte: (times.append(kernels[1].now), plain(byte))[1]
    buses[1].attach(0x2A, registers)
    return kernels, buses, times


def test_a_visitor_lives_in_the_bus_s_time(pair, registers):
    kernels, buses, times = pair
    join_buses(*zip(kernels, buses, strict=True))
    process = kernels[0].process(buses[0].transfer([I2cMessage(0x2A, bytearray([1, 2]))]))
    joined = JoinedKernel(kernels)
    while not process.processed:
        joined.step()
    bit = buses[0].bit_ps
    assert times == [(1 + 2 * 9) * bit, (1 + 3 * 9) * bit]
    assert registers.log == [[1, 2], -1]


def test_addresses_that_clash(pair, registers):
    kernels, buses, _ = pair
    buses[0].attach(0x2A, registers)
    with pytest.raises(ValueError, match="0x2a is taken already"):
        join_buses(*zip(kernels, buses, strict=True))


def test_a_target_moves(registers):
    bus = I2cBus(Kernel())
    bus.attach(0x1A, registers)
    bus.move(0x1A, 0x1A)
    bus.move(0x1A, 0x2B)
    assert dict(bus.targets) == {0x2B: registers}
    with pytest.raises(ValueError, match="no I2C device is at address 0x1a"):
        bus.move(0x1A, 0x2C)
    with pytest.raises(ValueError, match=r"0x80 is not in 0x08\.\.0x77"):
        bus.move(0x2B, 0x80)
    assert dict(bus.targets) == {0x2B: registers}
