"""The I2C bus: bits counted by hand, targets called like slave peripherals."""

import errno

import pytest

from cubestack.emulator.bus.i2c import I2cBus, I2cError, I2cMessage
from cubestack.emulator.sim.virtual_time import Kernel

from .ends import Memory

BIT_PS = {100_000: 10_000_000, 400_000: 2_500_000}


def make(hz: int = 100_000, **targets: Memory) -> tuple[Kernel, I2cBus]:
    kernel = Kernel()
    bus = I2cBus(kernel, hz)
    for name, target in targets.items():
        bus.attach(int(name[1:], 16), target)
    return kernel, bus


def perform(kernel: Kernel, bus: I2cBus, *messages: I2cMessage) -> None:
    kernel.run(until=kernel.process(bus.transfer(list(messages))))


def failure(kernel: Kernel, bus: I2cBus, *messages: I2cMessage) -> tuple[int, str]:
    with pytest.raises(I2cError) as raised:
        perform(kernel, bus, *messages)
    return raised.value.errno, raised.value.strerror


@pytest.mark.parametrize("hz", BIT_PS)
@pytest.mark.parametrize(
    ("messages", "bits"),
    [
        *(([I2cMessage(0x1A, probe_read=read)], 1 + 9 + 1) for read in (False, True)),
        ([I2cMessage(0x1A, bytearray(3))], 1 + 9 + 3 * 9 + 1),
        ([I2cMessage(0x1A, read=4)], 1 + 9 + 4 * 9 + 1),
        ([I2cMessage(0x1A, bytearray(1)), I2cMessage(0x1A, read=8)], 1 + 18 + 1 + 9 + 72 + 1),
    ],
)
def test_i2c_transfers_take_their_wire_time(hz, messages, bits):
    """A start and a stop of one bit each, nine bits a byte, the address included."""
    kernel, bus = make(hz, x1A=Memory())
    perform(kernel, bus, *messages)
    assert kernel.now == bits * BIT_PS[hz]


def test_repeated_start_joins_a_write_and_a_read():
    kernel, bus = make(x1A=(target := Memory()))
    reading = I2cMessage(0x1A, read=3)
    perform(kernel, bus, I2cMessage(0x1A, bytearray([0x83])), reading)
    assert target.calls == ["write", 0x83, "read", "stop"]
    assert reading.data == bytes([0, 1, 2])


@pytest.mark.parametrize(("probe_read", "direction"), [(False, "write"), (True, "read")])
def test_i2c_probe_sends_only_the_address(probe_read, direction):
    kernel, bus = make(x1A=(target := Memory()))
    perform(kernel, bus, I2cMessage(0x1A, probe_read=probe_read))
    assert target.calls == [direction, "stop"]


def test_transfer_over_two_targets_stops_the_first_one_at_the_change():
    order: list[str] = []
    first, second = Memory(), Memory()
    first.i2c_stop = lambda: order.append("first stops")
    second.i2c_start = lambda _read: order.append("second starts")
    kernel, bus = make(x1A=first, x1B=second)
    perform(kernel, bus, I2cMessage(0x1A, bytearray([1])), I2cMessage(0x1B, bytearray([2])))
    assert order == ["first stops", "second starts"]
    assert (first.calls, second.calls) == (["write", 1], [2, "stop"])


def test_missing_target_stops_the_open_one_and_frees_the_bus():
    kernel, bus = make(x1A=(target := Memory()))
    nobody = (errno.ENXIO, "no I2C device answers at 0x30")
    assert failure(kernel, bus, I2cMessage(0x30, bytearray([1, 2, 3]))) == nobody
    assert kernel.now == (1 + 9 + 1) * BIT_PS[100_000]  # no data after the address
    assert failure(kernel, bus, I2cMessage(0x1A, bytearray([1])), I2cMessage(0x30)) == nobody
    perform(kernel, bus, I2cMessage(0x1A, bytearray([7])))
    assert target.calls == ["write", 1, "stop", "write", 7, "stop"]


def test_refused_byte_ends_the_transfer():
    kernel, bus = make(x1A=(target := Memory(refuse=2)))
    messages = I2cMessage(0x1A, bytearray([1, 2, 3])), I2cMessage(0x1A, read=1)
    refused = (errno.EIO, "I2C device 0x1a did not acknowledge byte 0x02")
    assert failure(kernel, bus, *messages) == refused
    assert target.calls == ["write", 1, 2, "stop"]
    assert kernel.now == (1 + 9 + 2 * 9 + 1) * BIT_PS[100_000]


def test_concurrent_transfers_wait_for_each_other():
    kernel, bus = make(x1A=(target := Memory()))
    for byte in (1, 2):
        kernel.process(bus.transfer([I2cMessage(0x1A, bytearray([byte]))]))
    kernel.run()
    assert target.calls == ["write", 1, "stop", "write", 2, "stop"]
    assert kernel.now == 2 * (1 + 9 + 9 + 1) * BIT_PS[100_000]


@pytest.mark.parametrize("granted", [False, True])
def test_cancelled_waiter_does_not_block_the_bus(granted):
    kernel, bus = make(x1A=(target := Memory()))
    first = bus.transfer([I2cMessage(0x1A, bytearray([1]))])
    kernel.process(first)
    kernel.step()
    impatient = bus.transfer([I2cMessage(0x1A, bytearray([2]))])
    turn = next(impatient)
    kernel.process(bus.transfer([I2cMessage(0x1A, bytearray([3]))]))
    while granted and not turn.triggered:
        kernel.step()
    impatient.close()
    kernel.run()
    assert target.calls == ["write", 1, "stop", "write", 3, "stop"]


@pytest.mark.parametrize(
    ("address", "text"),
    [(0x1A, "0x1a is already in use")]
    + [(address, r"is not in 0x08\.\.0x77") for address in (-1, 0x00, 0x07, 0x78, 0x3FF)],
)
def test_rejects_reserved_and_used_addresses(address, text):
    _, bus = make(x1A=Memory())
    with pytest.raises(ValueError, match=text):
        bus.attach(address, Memory())


def test_i2c_target_moves_to_a_free_valid_address():
    target = Memory()
    _, bus = make(x1A=target)
    bus.move(0x1A, 0x1A)
    bus.move(0x1A, 0x2B)
    assert dict(bus.targets) == {0x2B: target}
    with pytest.raises(ValueError, match="no I2C device is at address 0x1a"):
        bus.move(0x1A, 0x2C)
    with pytest.raises(ValueError, match=r"0x80 is not in 0x08\.\.0x77"):
        bus.move(0x2B, 0x80)
    assert dict(bus.targets) == {0x2B: target}


def test_bit_rate_must_be_positive():
    with pytest.raises(ValueError, match="positive bit rate, not 0 Hz"):
        make(0)


def test_target_stretches_the_clock_until_it_has_a_byte():
    kernel, bus = make(x1A=(target := Memory()))
    ready, read = 50 * BIT_PS[100_000], target.i2c_read
    target.i2c_read = lambda: read() if kernel.now >= ready else None
    reading = I2cMessage(0x1A, read=2)
    perform(kernel, bus, reading)
    assert reading.data == bytes([0, 1])
    assert kernel.now == ready + (2 * 9 + 1) * BIT_PS[100_000]


def test_transfer_times_out_when_the_clock_is_held_low():
    kernel, bus = make(x1A=(target := Memory()))
    target.i2c_read = lambda: None
    held = (errno.ETIMEDOUT, "I2C device 0x1a held the clock low for over 1 s")
    assert failure(kernel, bus, I2cMessage(0x1A, read=1)) == held
    assert target.calls[-1] == "stop"


def test_general_call_reaches_listening_targets_only():
    kernel, bus = make(x1A=(deaf := Memory()))
    nobody = (errno.ENXIO, "no I2C device answers at 0x00")
    assert failure(kernel, bus, I2cMessage(0, bytearray([6]))) == nobody
    listeners = [Memory(refuse=6), Memory(refuse=7)]
    for address, target in enumerate(listeners, 0x20):
        bus.attach(address, target, general_call=True)
    perform(kernel, bus, I2cMessage(0, bytearray([6, 7])))  # one acknowledge is enough
    assert deaf.calls == []
    assert [target.calls for target in listeners] == [["write", 6, 7, "stop"]] * 2
    assert failure(kernel, bus, I2cMessage(0, read=1)) == nobody


@pytest.mark.parametrize("length", [1, 32])
@pytest.mark.parametrize("rest", [1, 2])  # the length alone, or a checksum as well
def test_smbus_block_read_takes_the_length_from_its_first_byte(length, rest):
    kernel, bus = make(x1A=(target := Memory()))
    target.i2c_read = iter([length, *range(100, 200)]).__next__
    reading = I2cMessage(0x1A, read=rest, block=True)
    perform(kernel, bus, reading)
    assert reading.data == bytes([length, *range(100, 100 + length + rest - 1)])
    assert kernel.now == (1 + 9 + 9 * (length + rest) + 1) * BIT_PS[100_000]


@pytest.mark.parametrize("length", [0, 33, 255])
def test_rejects_block_lengths_outside_1_to_32(length):
    kernel, bus = make(x1A=(target := Memory()))
    target.i2c_read = lambda: length
    wrong = (errno.EPROTO, f"I2C device 0x1a sent block length {length}, not 1..32")
    assert failure(kernel, bus, I2cMessage(0x1A, read=1, block=True)) == wrong
    assert target.calls[-1] == "stop"
