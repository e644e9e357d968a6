"""I2C: the master's flags and times as a driver sees them; the slave, stretched or not."""

import pytest

from cubestack.emulator.iss.outcome import Kind

from .bench import SYSTEM_REQUEST, Bench, S, asleep, mask_of

HZ = 14_000_000
BIT_PS = (8 * (16 + 1) + 4) * S // HZ
WIRED_AND = 8
PD14 = 3 * 16 + 14


def flag(*names: str) -> int:
    return sum(mask_of(f"I2C.IF.{name}") for name in names)


def command(name: str) -> int:
    return mask_of(f"I2C.CMD.{name}")


def routed(control: int = 1) -> Bench:
    """I2C0 on PD14 and PD15, about 100 kHz."""
    bench = Bench().clock("I2C0", "GPIO")
    bench["GPIO.PD_MODEH"] = WIRED_AND << 24 | WIRED_AND << 28
    bench["I2C0.CLKDIV"] = 16
    bench["I2C0.ROUTE"] = 3 | 3 << 8
    bench["I2C0.CTRL"] = control
    return bench


def master(control: int = 1) -> Bench:
    bench = routed(control)
    bench["I2C0.CMD"] = command("ABORT")
    bench.out(Kind.I2C_STOP)
    return bench


def bits(bench: Bench, count: int) -> None:
    bench.run_for(count * BIT_PS + 10**6)


def state(bench: Bench) -> int:
    return bench["I2C0.STATE"]


def one(bench: Bench, kind: Kind) -> int:
    [item] = bench.out(kind)
    assert item.unit == PD14 << 8
    return item.value


# -- master --


def test_after_enabling_the_bus_counts_as_busy_until_it_is_aborted() -> None:
    bench = routed()
    assert state(bench) == 0x01
    bench["I2C0.CMD"] = command("START")
    bits(bench, 3)
    assert bench["I2C0.STATUS"] & 1  # pending
    bench["I2C0.CMD"] = command("ABORT")
    bits(bench, 2)
    assert bench["I2C0.IF"] & flag("START")


def test_a_write_as_the_vendors_driver_does_it() -> None:
    bench = master()
    bench["I2C0.TXDATA"] = 0xA0
    bench["I2C0.CMD"] = command("START")
    began = bench.now
    bits(bench, 1)
    assert bench["I2C0.IF"] & flag("START")
    bits(bench, 8)
    [item] = bench.out(Kind.I2C_START)
    assert item.value == 0xA0
    assert abs(item.time_ps - began - 9 * BIT_PS) < 10**6
    assert state(bench) == 0x67  # address sent, waiting for the acknowledge
    bench.machine.i2c_answer(0, True)
    assert not bench["I2C0.IF"] & flag("ACK")
    bits(bench, 1)
    assert bench["I2C0.IF"] & flag("ACK", "BUSHOLD") == flag("ACK", "BUSHOLD")
    assert state(bench) == 0x97
    bench["I2C0.IFC"] = flag("ACK")
    bench["I2C0.TXDATA"] = 0x12
    bits(bench, 8)
    assert one(bench, Kind.I2C_WRITE) == 0x12
    bench.machine.i2c_answer(0, True)
    bits(bench, 1)
    assert state(bench) == 0xD7
    assert bench["I2C0.IF"] & flag("TXC")
    bench["I2C0.CMD"] = command("STOP")
    bits(bench, 1)
    assert bench["I2C0.IF"] & flag("MSTOP")
    assert state(bench) == 0
    one(bench, Kind.I2C_STOP)


def test_an_address_that_nobody_knows_is_refused() -> None:
    bench = master()
    bench["I2C0.TXDATA"] = 0x42
    bench["I2C0.CMD"] = command("START")
    bits(bench, 9)
    bench.machine.i2c_answer(0, False)
    bits(bench, 1)
    assert bench["I2C0.IF"] & flag("NACK", "ACK") == flag("NACK")
    assert state(bench) == 0x9F
    bench["I2C0.CMD"] = command("STOP")
    bits(bench, 1)
    assert bench["I2C0.IF"] & flag("MSTOP")


def test_write_then_read_with_a_repeated_start() -> None:
    bench = master()
    bench["I2C0.TXDATA"] = 0xD0
    bench["I2C0.CMD"] = command("START")
    bits(bench, 9)
    bench.machine.i2c_answer(0, True)
    bits(bench, 1)
    bench["I2C0.TXDATA"] = 0x75
    bits(bench, 8)
    bench.machine.i2c_answer(0, True)
    bits(bench, 1)
    bench.out(Kind.I2C_START)
    bench["I2C0.CMD"] = command("START")
    bench["I2C0.TXDATA"] = 0xD1
    bits(bench, 9)
    assert bench["I2C0.IF"] & flag("RSTART")
    assert one(bench, Kind.I2C_START) == 0xD1
    bench.machine.i2c_answer(0, True)
    bits(bench, 1)
    [item] = bench.out(Kind.I2C_READ)
    assert item.extra == 0
    bits(bench, 20)  # the slave stretches
    assert not bench["I2C0.IF"] & flag("RXDATAV")
    bench.machine.i2c_answer(0, True, 0x68)
    bits(bench, 8)
    assert bench["I2C0.IF"] & flag("RXDATAV")
    assert state(bench) == 0xB3
    assert bench["I2C0.RXDATA"] == 0x68
    bench["I2C0.CMD"] = command("ACK")
    bits(bench, 1)
    [item] = bench.out(Kind.I2C_READ)
    assert item.extra == 1
    bench.machine.i2c_answer(0, True, 0x99)
    bits(bench, 8)
    assert bench["I2C0.RXDATA"] == 0x99
    bench["I2C0.CMD"] = command("NACK")
    bench["I2C0.CMD"] = command("STOP")
    bits(bench, 2)
    assert bench["I2C0.IF"] & flag("MSTOP")
    assert not bench.out(Kind.I2C_READ)


@pytest.mark.parametrize(("ratio", "cycles"), [(0, 8), (1, 9), (2, 17)])
def test_the_clock_follows_its_divider_and_ratio(ratio: int, cycles: int) -> None:
    bench = master(1 | ratio << 8)
    bench["I2C0.CLKDIV"] = 3
    bench["I2C0.TXDATA"] = 0xA0
    began = bench.now
    bench["I2C0.CMD"] = command("START")
    bench.run_for(10**9)
    [item] = bench.out(Kind.I2C_START)
    assert abs(item.time_ps - began - 9 * (cycles * 4 + 4) * S // HZ) < 2 * S // HZ


def test_automatic_stop_and_acknowledge() -> None:
    bench = master(1 | mask_of("I2C.CTRL.AUTOSE") | mask_of("I2C.CTRL.AUTOACK"))
    bench["I2C0.TXDATA"] = 0xA0
    bench["I2C0.CMD"] = command("START")
    bits(bench, 9)
    bench.machine.i2c_answer(0, True)
    bits(bench, 2)
    assert bench["I2C0.IF"] & flag("MSTOP")


def test_lost_arbitration_and_bus_error_end_the_transfer() -> None:
    for answer, name in ((-1, "ARBLOST"), (-2, "BUSERR")):
        bench = master()
        bench["I2C0.TXDATA"] = 0xA0
        bench["I2C0.CMD"] = command("START")
        bits(bench, 9)
        bench.machine._library.iss_i2c_answer(bench.machine.handle, 0, answer, 0)
        assert bench["I2C0.IF"] & flag(name)
        assert not state(bench) & 2


def test_an_idle_bus_is_found_by_its_time_out() -> None:
    bench = routed()
    bench["I2C0.CTRL"] = 1 | 1 << 12 | mask_of("I2C.CTRL.GIBITO")
    bench.run_for(41 * 17 * S // HZ)
    assert bench["I2C0.IF"] & flag("BITO")
    assert state(bench) == 0


def test_a_clock_held_low_for_too_long_is_reported() -> None:
    bench = master(1 | 1 << 16)
    bench["I2C0.CMD"] = command("START")  # and no address: the bus is held
    bits(bench, 2)
    assert bench["I2C0.IF"] & flag("BUSHOLD")
    bench.run_for(41 * 17 * S // HZ)
    assert bench["I2C0.IF"] & flag("CLTO")


# -- slave --

SLAVE = 1 | 2
ADDRESS = 0x34


def slave(control: int = SLAVE) -> Bench:
    bench = routed(control)
    bench["I2C0.SADDR"] = ADDRESS
    bench["I2C0.SADDRMASK"] = 0xFE
    return bench


def test_a_slave_that_acknowledges_by_itself() -> None:
    bench = slave(SLAVE | mask_of("I2C.CTRL.AUTOACK"))
    machine = bench.machine
    assert machine.i2c_slave_start(0, 0x50) == 0
    machine.i2c_slave_stop(0)
    assert bench["I2C0.IF"] & flag("ADDR", "SSTOP") == flag("SSTOP")
    bench["I2C0.IFC"] = flag("SSTOP")
    assert machine.i2c_slave_start(0, ADDRESS) == 1
    assert bench["I2C0.IF"] & flag("ADDR", "RXDATAV") == flag("ADDR", "RXDATAV")
    assert bench["I2C0.RXDATA"] == ADDRESS
    assert machine.i2c_slave_write(0, 0x11) == 1
    assert bench["I2C0.RXDATA"] == 0x11
    machine.i2c_slave_stop(0)
    assert bench["I2C0.IF"] & flag("SSTOP")


def test_a_byte_that_is_not_fetched_holds_the_clock() -> None:
    bench = slave(SLAVE | mask_of("I2C.CTRL.AUTOACK"))
    machine = bench.machine
    assert machine.i2c_slave_start(0, ADDRESS) == 1
    assert machine.i2c_slave_write(0, 0x11) is None  # the address is still in the buffer
    assert machine.i2c_slave_poll(0) is None
    assert bench["I2C0.IF"] & flag("BUSHOLD")
    assert bench["I2C0.RXDATA"] == ADDRESS
    assert one(bench, Kind.I2C_SLAVE) == 1
    assert machine.i2c_slave_poll(0) == 1
    assert bench["I2C0.RXDATA"] == 0x11


def test_a_slave_that_decides_by_command() -> None:
    bench = slave()
    machine = bench.machine
    assert machine.i2c_slave_start(0, ADDRESS) is None
    assert state(bench) == 0x71
    bench["I2C0.CMD"] = command("ACK")
    assert machine.i2c_slave_poll(0) == 1
    bench["I2C0.RXDATA"]
    assert machine.i2c_slave_write(0, 0x22) is None
    assert state(bench) == 0xB1
    bench["I2C0.CMD"] = command("NACK")
    assert machine.i2c_slave_poll(0) == 0
    assert machine.i2c_slave_write(0, 0x33) == 0


def test_a_slave_sends_when_it_has_something() -> None:
    bench = slave(SLAVE | mask_of("I2C.CTRL.AUTOACK"))
    machine = bench.machine
    assert machine.i2c_slave_start(0, ADDRESS | 1) == 1
    assert bench["I2C0.RXDATA"] == ADDRESS | 1
    assert machine.i2c_slave_read(0) is None
    bench["I2C0.TXDATA"] = 0x5A
    assert machine.i2c_slave_poll(0) == 0x5A
    assert bench["I2C0.IF"] & flag("TXBL")
    bench["I2C0.TXDATA"] = 0x5B
    assert machine.i2c_slave_read(0, acknowledged=True) == 0x5B
    assert bench["I2C0.IF"] & flag("ACK")
    machine.i2c_slave_stop(0)
    assert bench["I2C0.IF"] & flag("NACK", "SSTOP") == flag("NACK", "SSTOP")


def test_a_repeated_start_is_flagged() -> None:
    bench = slave(SLAVE | mask_of("I2C.CTRL.AUTOACK"))
    machine = bench.machine
    machine.i2c_slave_start(0, ADDRESS)
    bench["I2C0.RXDATA"]
    machine.i2c_slave_write(0, 0x83)
    bench["I2C0.RXDATA"]
    assert not bench["I2C0.IF"] & flag("RSTART")
    assert machine.i2c_slave_start(0, ADDRESS | 1) == 1
    assert bench["I2C0.IF"] & flag("RSTART")


def test_the_mask_and_the_general_call() -> None:
    bench = slave(SLAVE | mask_of("I2C.CTRL.AUTOACK"))
    machine = bench.machine
    assert machine.i2c_slave_start(0, 0) == 0
    machine.i2c_slave_stop(0)
    bench.set("I2C0.CTRL.GCAMEN")
    assert machine.i2c_slave_start(0, 0) == 1
    machine.i2c_slave_stop(0)
    bench["I2C0.SADDRMASK"] = 0xF0
    bench["I2C0.RXDATA"]
    assert machine.i2c_slave_start(0, ADDRESS ^ 0x0E) == 1


def test_without_pins_clock_or_enable_nobody_is_there() -> None:
    for name, value in (
        ("I2C0.ROUTE", 1 | 3 << 8),
        ("I2C0.CTRL", 2),
        ("I2C0.CTRL", 1),
        ("GPIO.PD_MODEH", 0),
        ("CMU.HFPERCLKEN0", 1 << 13),
    ):
        bench = slave(SLAVE | mask_of("I2C.CTRL.AUTOACK"))
        bench[name] = value
        assert bench.machine.i2c_slave_start(0, ADDRESS) == 0


def test_its_address_wakes_a_slave_that_sleeps_with_the_clock_held() -> None:
    bench = asleep(2).clock("I2C0", "GPIO")
    bench["GPIO.PD_MODEH"] = WIRED_AND << 24 | WIRED_AND << 28
    bench["I2C0.ROUTE"] = 3 | 3 << 8
    bench["I2C0.CTRL"] = SLAVE | mask_of("I2C.CTRL.AUTOACK")
    bench["I2C0.SADDR"] = ADDRESS
    bench["I2C0.SADDRMASK"] = 0xFE
    bench["I2C0.IEN"] = flag("ADDR")
    machine = bench.machine
    assert machine.i2c_slave_start(0, 0x50) == 0
    machine.i2c_slave_stop(0)
    bench.run_for(10 * 10**6)
    assert machine.energy_mode == 2
    assert machine.i2c_slave_start(0, ADDRESS) is None
    bench.run_for(10 * 10**6)
    assert machine.energy_mode == 0
    assert one(bench, Kind.I2C_SLAVE) == 1
    assert machine.i2c_slave_poll(0) == 1


def test_a_reset_lets_the_bus_go() -> None:
    bench = slave()
    assert bench.machine.i2c_slave_start(0, ADDRESS) is None
    bench.reset(SYSTEM_REQUEST)
    assert bench.machine.i2c_slave_poll(0) == 0
    bench = master()
    bench["I2C0.TXDATA"] = 0xA0
    bench["I2C0.CMD"] = command("START")
    bits(bench, 5)
    bench.reset(SYSTEM_REQUEST)
    assert len(bench.out(Kind.I2C_STOP)) == 1
    assert state(bench.clock("I2C0")) == 1


def test_both_ends_can_be_found_by_their_pin() -> None:
    bench = slave(SLAVE | mask_of("I2C.CTRL.AUTOACK"))
    assert bench.machine.i2c_slave_start(0x100, ADDRESS) == 0
    assert bench.machine.i2c_slave_start(0x100 | PD14, ADDRESS) == 1
