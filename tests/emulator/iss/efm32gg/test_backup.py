"""Backup domain: entry and end of backup mode, what survives it, BURTC and retention in EM4."""

from pathlib import Path

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind
from tests.emulator.iss.cross_compiler import needs_compiler

from .bench import MS, Bench, S, compiled, mask_of

VDD, BU_VIN = 9, 27
PORST, EM4RST, EM4WURST, BUMODERST = 1, 1 << 7, 1 << 8, 1 << 15
LFRCO, LFXO, ULFRCO = 1, 2, 3
EM4EN = 3
RSTEN, STAMP = mask_of("BURTC.CTRL.RSTEN"), mask_of("BURTC.CTRL.BUMODETSEN")
VREGEN, BURTCWU = 1, 2
EM4_SEQUENCE = (2, 3, 2, 3, 2, 3, 2, 3, 2)
PE3 = 4 * 16 + 3


def supply(bench: Bench, main: float, backup: float = 3.0) -> None:
    bench.machine.analog[VDD], bench.machine.analog[BU_VIN] = main, backup
    bench.machine.analog_changed()


def backed(em4conf: int = VREGEN, clock: int = ULFRCO, more: int = STAMP) -> Bench:
    """A part on 3.3 V with a backup supply, BURTC counting at about 1 kHz, backup mode ready."""
    bench = Bench().clock("LE", "GPIO")
    supply(bench, 3.3)
    bench.load("CMU", OSCENCMD=0x40)
    bench.run_for(MS)
    bench.load("RMU", CTRL=0, CMD=1)
    bench.load("EMU", EM4CONF=em4conf, BUCTRL=1)
    bench.load("BURTC", CTRL=EM4EN | clock << 12 | 5 << 8 | more, RET0_REG=0xCAFE, RET127_REG=7)
    bench.run_for(5 * MS)
    assert bench.is_set("EMU.STATUS.BURDY")
    return bench


def cause(bench: Bench) -> int:
    """Causes of the reset that just came; the low-energy bus is accessible again."""
    bench.run_for(MS)
    bench.clock("LE")
    return bench["RMU.RSTCAUSE"]


def retained(bench: Bench) -> tuple[int, int]:
    return bench["BURTC.RET0_REG"], bench["BURTC.RET127_REG"]


def test_backup_becomes_ready_and_interrupts() -> None:
    bench = Bench()
    bench.load("EMU", IEN=1, BUCTRL=1)
    assert not bench.is_set("EMU.STATUS.BURDY")
    bench.run_for(2 * MS)
    assert bench.is_set("EMU.STATUS.BURDY")
    assert bench.pending() == [38]
    bench["EMU.BUCTRL"] = 0
    assert not bench.is_set("EMU.STATUS.BURDY")


def test_counter_and_retention_survive_the_loss_of_the_main_supply() -> None:
    bench = backed()
    bench.machine.poke(0x2000_0000, b"gone")
    before = bench["BURTC.CNT"]
    supply(bench, 0.0)
    bench.run_for(S)
    assert bench.machine.energy_mode == 4
    supply(bench, 3.3)
    assert cause(bench) == BUMODERST
    assert retained(bench) == (0xCAFE, 7)
    assert abs(bench["BURTC.CNT"] - before - 1000) <= 3
    assert bench.is_set("BURTC.STATUS.BUMODETS")
    assert abs(bench["BURTC.TIMESTAMP"] - before) <= 1
    bench["BURTC.CMD"] = 1
    assert not bench["BURTC.STATUS"]


def test_entry_is_not_stamped_unless_wanted() -> None:
    bench = backed(more=0)
    supply(bench, 0.0)
    bench.run_for(MS)
    supply(bench, 3.3)
    assert cause(bench) == BUMODERST
    assert not bench["BURTC.STATUS"]


@pytest.mark.parametrize(
    ("main", "backup", "enters"),
    [(1.7, 3.0, True), (1.9, 3.0, False), (0.0, 1.7, False), (0.0, 0.0, False)],
)
def test_backup_mode_needs_a_low_main_and_a_good_backup_supply(
    main: float, backup: float, enters: bool
) -> None:
    bench = backed()
    supply(bench, main, backup)
    bench.run_for(MS)
    assert (bench.machine.energy_mode == 4) == enters


@pytest.mark.parametrize("off", ["EMU.BUCTRL", "EMU.ROUTE"])
def test_backup_mode_needs_to_be_enabled(off: str) -> None:
    bench = backed()
    bench[off] = 0
    supply(bench, 0.0)
    bench.run_for(MS)
    assert bench.machine.energy_mode == 0


def test_main_supply_must_return_above_the_threshold() -> None:
    bench = backed()
    supply(bench, 1.0)
    supply(bench, 1.8)
    bench.run_for(MS)
    assert bench.machine.energy_mode == 4
    supply(bench, 1.9)
    assert cause(bench) == BUMODERST


def test_loss_of_the_backup_supply_too_is_a_power_on_reset() -> None:
    bench = backed()
    supply(bench, 0.0)
    supply(bench, 0.0, 1.0)
    supply(bench, 3.3, 3.0)
    assert cause(bench) == PORST
    bench["RMU.CTRL"] = 0
    assert retained(bench) == (0, 0)
    assert bench["BURTC.CTRL"] == RSTEN


def test_neither_pin_nor_counter_ends_backup_mode() -> None:
    bench = backed(VREGEN | BURTCWU)
    bench.load("BURTC", COMP0=bench["BURTC.CNT"] + 20, IFC=2, IEN=2)
    bench.load("GPIO", PA_MODEL=1, EM4WUEN=1, EM4WUPOL=1)
    bench.run_for(10 * MS)
    supply(bench, 0.0)
    bench.run_for(100 * MS)
    bench.machine.pin(0, 0, 1)
    bench.run_for(100 * MS)
    assert bench.machine.energy_mode == 4
    supply(bench, 3.3)
    assert cause(bench) == BUMODERST
    assert bench.is_set("BURTC.IF.COMP0")


def test_status_pin_is_high_in_backup_mode() -> None:
    bench = backed()
    bench.load("GPIO", PE_MODEL=4 << 12)
    bench["EMU.BUCTRL"] = 1 | mask_of("EMU.BUCTRL.STATEN")
    assert bench.machine.pin_level(4, 3) == 0
    bench.out(OutgoingKind.PIN)
    supply(bench, 0.0)
    assert bench.machine.pin_level(4, 3) == 1
    [(_, pin, level)] = bench.pins()
    assert (pin, level) == (PE3, 1)


def em4(bench: Bench) -> None:
    for value in EM4_SEQUENCE:
        bench["EMU.CTRL"] = value << 2
    assert bench.machine.energy_mode == 4


@pytest.mark.parametrize("regulator", [0, VREGEN])
def test_em4_keeps_the_backup_domain_with_the_regulator_only(regulator: int) -> None:
    bench = backed(regulator)
    before = bench["BURTC.CNT"]
    bench.load("GPIO", PA_MODEL=1, EM4WUEN=1, EM4WUPOL=1)
    em4(bench)
    bench.run_for(S)
    bench.machine.pin(0, 0, 1)
    assert cause(bench) == EM4RST | EM4WURST
    if regulator:
        assert retained(bench) == (0xCAFE, 7)
        assert abs(bench["BURTC.CNT"] - before - 1000) <= 3
    else:
        assert retained(bench) == (0, 0)
        assert bench["BURTC.CTRL"] == RSTEN


@pytest.mark.parametrize(
    ("clock", "oscillator", "counts"),
    [(LFRCO, 1, True), (LFRCO, 2, False), (LFRCO, 0, False), (ULFRCO, 0, True), (ULFRCO, 1, True)],
)
def test_em4_runs_one_oscillator(clock: int, oscillator: int, counts: bool) -> None:
    bench = backed(VREGEN | oscillator << 2, clock)
    before = bench["BURTC.CNT"]
    bench.load("GPIO", PA_MODEL=1, EM4WUEN=1, EM4WUPOL=1)
    em4(bench)
    bench.run_for(S)
    bench.machine.pin(0, 0, 1)
    cause(bench)
    assert (bench["BURTC.CNT"] - before > 900) == counts


def test_counter_wakes_from_em4() -> None:
    bench = backed(VREGEN | BURTCWU)
    bench.load("BURTC", COMP0=bench["BURTC.CNT"] + 200, IFC=2, IEN=2)
    bench.run_for(10 * MS)
    em4(bench)
    bench.run_for(150 * MS)
    assert bench.machine.energy_mode == 4
    bench.run_for(100 * MS)
    assert cause(bench) == EM4RST | EM4WURST
    assert bench.is_set("BURTC.IF.COMP0")


CLOCK = """
/* Counts its starts in a retention register; keeps the time on the backup supply. */
int main(void) {
    uint32_t cause = RMU->RSTCAUSE;
    RMU->CMD = RMU_CMD_RCCLR;
    EMU->AUXCTRL = EMU_AUXCTRL_HRCCLR;
    EMU->AUXCTRL = 0;
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    RMU->CTRL &= ~RMU_CTRL_BURSTEN;
    if (cause & RMU_RSTCAUSE_BUMODERST) {
        BURTC->RET0_REG++;
    } else {
        BURTC->RET0_REG = 0;
        BURTC->CTRL = 3 | 3 << BURTC_CTRL_CLKSEL_SHIFT | 1 << BURTC_CTRL_PRESC_SHIFT |
                      BURTC_CTRL_BUMODETSEN;
    }
    EMU->EM4CONF = EMU_EM4CONF_VREGEN;
    EMU->BUCTRL = EMU_BUCTRL_EN;
    while (!(EMU->STATUS & EMU_STATUS_BURDY)) ;
    RESULT[0] = BURTC->RET0_REG;
    RESULT[1] = BURTC->CNT;
    RESULT[2] = BURTC->TIMESTAMP;
    for (;;)
        __asm volatile("wfi");
}
"""


@needs_compiler
def test_program_keeps_time_over_three_losses_of_supply(tmp_path: Path) -> None:
    bench = Bench(image=compiled(CLOCK, tmp_path))
    supply(bench, 3.3)
    bench.run_for(100 * MS)
    for start in range(1, 4):
        supply(bench, 0.0)
        bench.run_for(900 * MS)
        supply(bench, 3.3)
        bench.run_for(100 * MS)
        result = [bench.machine.read(0x2001_0000 + 4 * n) or 0 for n in range(3)]
        assert result[0] == start
        assert abs(result[1] - 1000 * start) <= 10
        assert abs(result[2] - 1000 * start + 900) <= 10
