"""BURTC and its retention registers."""

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind

from ..bench import MS, POWER_ON, SYSTEM_REQUEST, WATCHDOG, Bench, S, mask_of
from .domain import BURTC_IRQ, NOT_PENDING, low

ULFRCO_2_KHZ = 3 << 12 | 1
ULFRCO = ULFRCO_2_KHZ | 1 << 8
LFRCO = 1 << 12 | 1


def burtc(control: int = 0, **registers: int) -> Bench:
    return low(1).load("RMU", CTRL=0).load("BURTC", CTRL=control, **registers)


def retained(bench: Bench) -> list[int]:
    return [bench[f"BURTC.RET{n}_REG"] for n in range(128)]


def test_backup_domain_is_held_in_reset_until_rmu_releases_it() -> None:
    bench = low(1)
    bench["BURTC.RET0_REG"] = 1
    assert bench["BURTC.RET0_REG"] == 0
    assert "BURSTEN" in bench.log()
    bench["RMU.CTRL"] = 0
    bench["BURTC.RET0_REG"] = 1
    assert bench["BURTC.RET0_REG"] == 1


def test_retention_registers_survive_every_reset_but_power_on() -> None:
    values = [0x1234_0000 + n for n in range(128)]
    bench = burtc(0, **{f"RET{n}_REG": value for n, value in enumerate(values)})
    for cause in (SYSTEM_REQUEST, WATCHDOG):
        bench.reset(cause)
        assert retained(bench.clock("LE")) == values
    bench.reset(POWER_ON)
    assert retained(bench.clock("LE")) == [0] * 128


def test_reset_of_the_backup_domain_keeps_the_retention_registers() -> None:
    bench = burtc(ULFRCO, RET7_REG=77)
    bench["RMU.CTRL"] = mask_of("RMU.CTRL.BURSTEN")
    bench["RMU.CTRL"] = 0
    assert bench["BURTC.CTRL"] == mask_of("BURTC.CTRL.RSTEN")
    assert bench["BURTC.RET7_REG"] == 77


def test_burtc_continues_over_a_reset() -> None:
    bench = burtc(ULFRCO)
    bench.run_for(100 * MS)
    assert abs(bench["BURTC.CNT"] - 100) <= 1
    bench.reset(SYSTEM_REQUEST)
    bench.run_for(100 * MS)
    bench.clock("LE")
    assert abs(bench["BURTC.CNT"] - 200) <= 2


def test_burtc_interrupts_at_its_compare_value() -> None:
    bench = burtc(COMP0=10, IEN=2)
    bench.run_for(MS)
    bench["BURTC.CTRL"] = ULFRCO
    bench.run_for(9 * MS)
    assert not bench.peek("BURTC.IF")
    bench.run_for(4 * MS)
    assert (bench.peek("BURTC.IF"), bench.pending()) == (2, [BURTC_IRQ])


def test_burtc_applies_prescaler_and_lock() -> None:
    bench = burtc(LFRCO | 7 << 8)
    bench.run_for(S)
    assert abs(bench["BURTC.CNT"] - 256) <= 1
    bench.load("BURTC", LOCK=0, CTRL=0)
    assert bench["BURTC.CTRL"] == LFRCO | 7 << 8
    assert "BURTC is locked" in bench.log()
    bench.load("BURTC", LOCK=0xAEE8, CTRL=8)
    assert bench["BURTC.CNT"] == 0


@pytest.mark.parametrize(("prescaler", "hz"), [(0, 2000), (1, 1000), (7, 1000)])
def test_burtc_on_ulfrco_counts_at_2_khz_undivided_and_else_at_1_khz(
    prescaler: int, hz: int
) -> None:
    bench = burtc(ULFRCO_2_KHZ | prescaler << 8)
    bench.run_for(S // 10)
    assert abs(bench["BURTC.CNT"] - hz // 10) <= 1


def test_burtc_write_takes_effect_although_the_part_keeps_entering_em2() -> None:
    bench = low(2, "RTC", interrupts=True).load("RMU", CTRL=0)
    bench.load("RTC", COMP0=15, IEN=2, CTRL=5).load("BURTC", CTRL=ULFRCO, COMP0=1000)
    for _ in range(10):  # wakes and sleeps again each half millisecond
        bench["RTC.IFC"] = 7
        bench.machine.write(NOT_PENDING, 1 << 30)
        bench.run_for(MS // 2)
    assert len(bench.out(OutgoingKind.SLEEP)) > 10
    assert (bench["BURTC.SYNCBUSY"], bench["BURTC.COMP0"]) == (0, 1000)
