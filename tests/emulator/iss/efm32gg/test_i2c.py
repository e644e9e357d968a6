"""I2C: flags and times of the master as a driver sees them; the slave, stretched or not."""

import pytest

from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import OutgoingKind

from .bench import SYSTEM_REQUEST, Bench, S, asleep, mask_of

HZ = 14_000_000
BIT_PS = (8 * (16 + 1) + 4) * S // HZ
WIRED_AND = 8
PD14 = 3 * 16 + 14


def flag(*names: str) -> int:
    return sum(mask_of(f"I2C.IF.{name}") for name in names)


def flags(bench: Bench, *names: str) -> int:
    """Value of these flags."""
    return bench["I2C0.IF"] & flag(*names)


def control(*names: str) -> int:
    return sum(mask_of(f"I2C.CTRL.{name}") for name in names)


def command(bench: Bench, *names: str) -> None:
    for name in names:
        bench["I2C0.CMD"] = mask_of(f"I2C.CMD.{name}")


def routed(value: int = 1, bench: Bench | None = None) -> Bench:
    """I2C0 on PD14 and PD15, about 100 kHz."""
    bench = (bench or Bench()).clock("I2C0", "GPIO")
    bench["GPIO.PD_MODEH"] = WIRED_AND << 24 | WIRED_AND << 28
    return bench.load("I2C0", CLKDIV=16, ROUTE=3 | 3 << 8, CTRL=value)


def master(value: int = 1) -> Bench:
    bench = routed(value)
    command(bench, "ABORT")
    bench.out(OutgoingKind.I2C_STOP)
    return bench


def bits(bench: Bench, count: int) -> None:
    bench.run_for(count * BIT_PS + 10**6)


def start(bench: Bench, address: int) -> None:
    """Send a start and an address byte."""
    bench["I2C0.TXDATA"] = address
    command(bench, "START")
    bits(bench, 9)


def answer(bench: Bench, acknowledged: bool) -> None:
    bench.machine.i2c_answer(0, acknowledged)
    bits(bench, 1)


def read(bench: Bench, byte: int, acknowledged_last: int) -> None:
    """Answer a read request with a byte."""
    [item] = bench.out(OutgoingKind.I2C_READ)
    assert item.extra == acknowledged_last
    bench.machine.i2c_answer(0, True, byte)
    bits(bench, 8)


def state(bench: Bench) -> int:
    return bench["I2C0.STATE"]


def one(bench: Bench, kind: OutgoingKind) -> int:
    [item] = bench.out(kind)
    assert item.unit == PD14 << 8
    return item.value


# -- master --


def test_enabled_bus_is_busy_until_abort() -> None:
    bench = routed()
    assert state(bench) == 0x01
    command(bench, "START")
    bits(bench, 3)
    assert bench["I2C0.STATUS"] & 1  # pending
    command(bench, "ABORT")
    bits(bench, 2)
    assert flags(bench, "START")


def test_write_transfer_like_the_vendor_driver() -> None:
    bench = master()
    bench["I2C0.TXDATA"] = 0xA0
    command(bench, "START")
    began = bench.now
    bits(bench, 1)
    assert flags(bench, "START")
    bits(bench, 8)
    [item] = bench.out(OutgoingKind.I2C_START)
    assert item.value == 0xA0
    assert abs(item.time_ps - began - 9 * BIT_PS) < 10**6
    assert state(bench) == 0x67  # address sent, waiting for the acknowledge
    bench.machine.i2c_answer(0, True)
    assert not flags(bench, "ACK")
    bits(bench, 1)
    assert flags(bench, "ACK", "BUSHOLD") == flag("ACK", "BUSHOLD")
    assert state(bench) == 0x97
    bench.load("I2C0", IFC=flag("ACK"), TXDATA=0x12)
    bits(bench, 8)
    assert one(bench, OutgoingKind.I2C_WRITE) == 0x12
    answer(bench, True)
    assert state(bench) == 0xD7
    assert flags(bench, "TXC")
    command(bench, "STOP")
    bits(bench, 1)
    assert flags(bench, "MSTOP")
    assert state(bench) == 0
    one(bench, OutgoingKind.I2C_STOP)


def test_unanswered_address_sets_nack() -> None:
    bench = master()
    start(bench, 0x42)
    answer(bench, False)
    assert flags(bench, "NACK", "ACK") == flag("NACK")
    assert state(bench) == 0x9F
    command(bench, "STOP")
    bits(bench, 1)
    assert flags(bench, "MSTOP")


def test_write_then_read_with_a_repeated_start() -> None:
    bench = master()
    start(bench, 0xD0)
    answer(bench, True)
    bench["I2C0.TXDATA"] = 0x75
    bits(bench, 8)
    answer(bench, True)
    bench.out(OutgoingKind.I2C_START)
    command(bench, "START")
    bench["I2C0.TXDATA"] = 0xD1
    bits(bench, 9)
    assert flags(bench, "RSTART")
    assert one(bench, OutgoingKind.I2C_START) == 0xD1
    answer(bench, True)
    bits(bench, 20)  # the slave stretches
    assert not flags(bench, "RXDATAV")
    read(bench, 0x68, 0)
    assert flags(bench, "RXDATAV")
    assert state(bench) == 0xB3
    assert bench["I2C0.RXDATA"] == 0x68
    command(bench, "ACK")
    bits(bench, 1)
    read(bench, 0x99, 1)
    assert bench["I2C0.RXDATA"] == 0x99
    command(bench, "NACK", "STOP")
    bits(bench, 2)
    assert flags(bench, "MSTOP")
    assert not bench.out(OutgoingKind.I2C_READ)


@pytest.mark.parametrize(("ratio", "cycles"), [(0, 8), (1, 9), (2, 17)])
def test_bit_rate_follows_divider_and_ratio(ratio: int, cycles: int) -> None:
    bench = master(1 | ratio << 8).load("I2C0", CLKDIV=3, TXDATA=0xA0)
    began = bench.now
    command(bench, "START")
    bench.run_for(10**9)
    [item] = bench.out(OutgoingKind.I2C_START)
    assert abs(item.time_ps - began - 9 * (cycles * 4 + 4) * S // HZ) < 2 * S // HZ


def test_autose_stops_after_the_last_byte() -> None:
    bench = master(1 | control("AUTOSE", "AUTOACK"))
    start(bench, 0xA0)
    bench.machine.i2c_answer(0, True)
    bits(bench, 2)
    assert flags(bench, "MSTOP")


@pytest.mark.parametrize(("result", "name"), [(-1, "ARBLOST"), (-2, "BUSERR")])
def test_lost_arbitration_and_bus_error_end_the_transfer(result: int, name: str) -> None:
    bench = master()
    start(bench, 0xA0)
    bench.machine._library.iss_i2c_answer(bench.machine.handle, 0, result, 0)
    assert flags(bench, name)
    assert not state(bench) & 2


def test_idle_time_out_releases_the_bus() -> None:
    bench = routed()
    bench["I2C0.CTRL"] = 1 | 1 << 12 | control("GIBITO")
    bench.run_for(41 * 17 * S // HZ)
    assert flags(bench, "BITO")
    assert state(bench) == 0


def test_clock_held_low_for_too_long_sets_clto() -> None:
    bench = master(1 | 1 << 16)
    command(bench, "START")  # without an address: the bus is held
    bits(bench, 2)
    assert flags(bench, "BUSHOLD")
    bench.run_for(41 * 17 * S // HZ)
    assert flags(bench, "CLTO")


# -- slave --

SLAVE = 1 | 2
ADDRESS = 0x34


def slave(*names: str, bench: Bench | None = None) -> tuple[Bench, Machine]:
    bench = routed(SLAVE | control(*names), bench)
    bench.load("I2C0", SADDR=ADDRESS, SADDRMASK=0xFE)
    return bench, bench.machine


def test_slave_with_autoack_acknowledges_its_address_and_data() -> None:
    bench, machine = slave("AUTOACK")
    assert machine.i2c_slave_start(0, 0x50) == 0
    machine.i2c_slave_stop(0)
    assert flags(bench, "ADDR", "SSTOP") == flag("SSTOP")
    bench["I2C0.IFC"] = flag("SSTOP")
    assert machine.i2c_slave_start(0, ADDRESS) == 1
    assert flags(bench, "ADDR", "RXDATAV") == flag("ADDR", "RXDATAV")
    assert bench["I2C0.RXDATA"] == ADDRESS
    assert machine.i2c_slave_write(0, 0x11) == 1
    assert bench["I2C0.RXDATA"] == 0x11
    machine.i2c_slave_stop(0)
    assert flags(bench, "SSTOP")


def test_unread_byte_stretches_the_clock() -> None:
    bench, machine = slave("AUTOACK")
    assert machine.i2c_slave_start(0, ADDRESS) == 1
    assert machine.i2c_slave_write(0, 0x11) is None  # the address is still in the buffer
    assert machine.i2c_slave_poll(0) is None
    assert flags(bench, "BUSHOLD")
    assert bench["I2C0.RXDATA"] == ADDRESS
    assert one(bench, OutgoingKind.I2C_SLAVE) == 1
    assert machine.i2c_slave_poll(0) == 1
    assert bench["I2C0.RXDATA"] == 0x11


def test_slave_acknowledges_by_command() -> None:
    bench, machine = slave()
    assert machine.i2c_slave_start(0, ADDRESS) is None
    assert state(bench) == 0x71
    command(bench, "ACK")
    assert machine.i2c_slave_poll(0) == 1
    bench["I2C0.RXDATA"]
    assert machine.i2c_slave_write(0, 0x22) is None
    assert state(bench) == 0xB1
    command(bench, "NACK")
    assert machine.i2c_slave_poll(0) == 0
    assert machine.i2c_slave_write(0, 0x33) == 0
    bench["I2C0.RXDATA"]
    assert machine.i2c_slave_start(0, ADDRESS | 1) is None
    assert state(bench) == 0x75  # transmitter


def test_slave_read_waits_for_data() -> None:
    bench, machine = slave("AUTOACK")
    assert machine.i2c_slave_start(0, ADDRESS | 1) == 1
    assert bench["I2C0.RXDATA"] == ADDRESS | 1
    assert machine.i2c_slave_read(0) is None
    bench["I2C0.TXDATA"] = 0x5A
    assert machine.i2c_slave_poll(0) == 0x5A
    assert flags(bench, "TXBL")
    bench["I2C0.TXDATA"] = 0x5B
    assert machine.i2c_slave_read(0, acknowledged=True) == 0x5B
    assert flags(bench, "ACK")
    machine.i2c_slave_stop(0)
    assert flags(bench, "NACK", "SSTOP") == flag("NACK", "SSTOP")


def test_repeated_start_sets_its_flag() -> None:
    bench, machine = slave("AUTOACK")
    machine.i2c_slave_start(0, ADDRESS)
    bench["I2C0.RXDATA"]
    machine.i2c_slave_write(0, 0x83)
    bench["I2C0.RXDATA"]
    assert not flags(bench, "RSTART")
    assert machine.i2c_slave_start(0, ADDRESS | 1) == 1
    assert flags(bench, "RSTART")


def test_i2c_slave_answers_masked_addresses_and_general_calls() -> None:
    bench, machine = slave("AUTOACK")
    assert machine.i2c_slave_start(0, 0) == 0
    machine.i2c_slave_stop(0)
    bench.set("I2C0.CTRL.GCAMEN")
    assert machine.i2c_slave_start(0, 0) == 1
    machine.i2c_slave_stop(0)
    bench["I2C0.SADDRMASK"] = 0xF0
    bench["I2C0.RXDATA"]
    assert machine.i2c_slave_start(0, ADDRESS ^ 0x0E) == 1


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("I2C0.ROUTE", 1 | 3 << 8),
        ("I2C0.CTRL", 2),
        ("I2C0.CTRL", 1),
        ("GPIO.PD_MODEH", 0),
        ("CMU.HFPERCLKEN0", 1 << 13),
    ],
)
def test_slave_without_pins_clock_or_enable_does_not_answer(name: str, value: int) -> None:
    bench, machine = slave("AUTOACK")
    bench[name] = value
    assert machine.i2c_slave_start(0, ADDRESS) == 0


def test_address_wakes_a_sleeping_slave_which_stretches_the_clock() -> None:
    bench, machine = slave("AUTOACK", bench=asleep(2))
    bench["I2C0.IEN"] = flag("ADDR")
    assert machine.i2c_slave_start(0, 0x50) == 0
    machine.i2c_slave_stop(0)
    bench.run_for(10 * 10**6)
    assert machine.energy_mode == 2
    assert machine.i2c_slave_start(0, ADDRESS) is None
    bench.run_for(10 * 10**6)
    assert machine.energy_mode == 0
    assert one(bench, OutgoingKind.I2C_SLAVE) == 1
    assert machine.i2c_slave_poll(0) == 1


def test_reset_releases_the_bus() -> None:
    bench, machine = slave()
    assert machine.i2c_slave_start(0, ADDRESS) is None
    bench.reset(SYSTEM_REQUEST)
    assert machine.i2c_slave_poll(0) == 0
    bench = master()
    bench["I2C0.TXDATA"] = 0xA0
    command(bench, "START")
    bits(bench, 5)
    bench.reset(SYSTEM_REQUEST)
    assert len(bench.out(OutgoingKind.I2C_STOP)) == 1
    assert state(bench.clock("I2C0")) == 1


def test_i2c_slave_is_found_by_its_pin() -> None:
    _, machine = slave("AUTOACK")
    assert machine.i2c_slave_start(0x100, ADDRESS) == 0
    assert machine.i2c_slave_start(0x100 | PD14, ADDRESS) == 1
