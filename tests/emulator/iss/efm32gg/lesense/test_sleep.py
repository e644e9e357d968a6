"""LESENSE while the part sleeps, alone and in a compiled program."""

from pathlib import Path

from tests.emulator.iss.cross_compiler import needs_compiler

from ..bench import MS, US, Bench, compiled
from .sensors import (
    BY_LEVEL,
    COMPLETE,
    IRQ,
    PERIODIC,
    POSITIVE,
    START,
    SUPPLY_V,
    VDD,
    configure,
    lesense,
    setif,
    volts,
)


def test_edge_of_a_sensor_wakes_from_em2() -> None:
    bench = lesense(2, CTRL=PERIODIC, CHEN=0x80, TIMCTRL=31 << 12, IEN=0x80)
    configure(bench, 7, INTERACT=BY_LEVEL | setif(POSITIVE))
    bench["LESENSE.CMD"] = START
    bench.run_for(100 * MS)
    assert bench.machine.energy_mode == 2
    assert bench.pending() == []
    volts(bench, 7, 3.0)
    bench.run_for(MS)
    assert bench.pending() == [IRQ]


def test_nothing_is_scanned_without_the_clock() -> None:
    bench = lesense(CTRL=PERIODIC, CHEN=1, TIMCTRL=9 << 12)
    bench["LESENSE.CMD"] = START
    bench.run_for(10 * MS)
    assert bench["LESENSE.IF"] & COMPLETE
    bench["CMU.LFACLKEN0"] = 0
    bench.run_for(MS)
    bench["LESENSE.IFC"] = COMPLETE
    bench.run_for(10 * MS)
    assert not bench["LESENSE.IF"] & COMPLETE
    bench["CMU.LFACLKEN0"] = 1
    bench.run_for(10 * MS)
    assert bench["LESENSE.IF"] & COMPLETE


BUTTONS = """
/* Counts touches of two sensors in EM2; the core sleeps between them. */
static volatile uint32_t touches[2];

void IRQ(void) {
    uint32_t flags = LESENSE->IF & LESENSE->IEN;
    LESENSE->IFC = flags;
    for (int n = 0; n < 2; n++)
        RESULT[n] = touches[n] += flags >> (4 + n) & 1;
}

int main(void) {
    CMU->OSCENCMD = CMU_OSCENCMD_LFRCOEN;
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_ACMP0;
    CMU->LFACLKEN0 = CMU_LFACLKEN0_LESENSE;
    ACMP0->INPUTSEL = 10 << ACMP_INPUTSEL_NEGSEL_SHIFT;
    LESENSE->CTRL = 0;
    LESENSE->TIMCTRL = 63u << LESENSE_TIMCTRL_PCTOP_SHIFT;
    LESENSE->PERCTRL = 2u << LESENSE_PERCTRL_ACMP0MODE_SHIFT;
    LESENSE->CHEN = 3 << 4;
    LESENSE->CH4_INTERACT = 40 | LESENSE_CH4_INTERACT_SAMPLE |
                            2u << LESENSE_CH4_INTERACT_SETIF_SHIFT;
    LESENSE->CH5_INTERACT = 20 | LESENSE_CH5_INTERACT_SAMPLE |
                            2u << LESENSE_CH5_INTERACT_SETIF_SHIFT;
    LESENSE->IEN = 3 << 4;
    while (LESENSE->SYNCBUSY) ;
    LESENSE->CMD = LESENSE_CMD_START;
    *(volatile uint32_t *)0xE000E100 = 1u << LESENSE_IRQ;
    *(volatile uint32_t *)0xE000ED10 = 4;
    for (;;)
        __asm volatile("wfi");
}
"""


@needs_compiler
def test_compiled_program_counts_touches(tmp_path: Path) -> None:
    bench = Bench(image=compiled(BUTTONS, tmp_path))
    bench.machine.analog[VDD] = SUPPLY_V
    bench.run_for(20 * MS)
    for channel, value in ((4, 1.5), (5, 1.5), (4, 3.0), (5, 0.2), (4, 0.2), (4, 2.5), (5, 3.0)):
        volts(bench, channel, value)  # thresholds: 2.1 V and 1.05 V
        bench.run_for(10 * MS)
        assert bench.machine.energy_mode == 2
    assert [bench.machine.read(0x2001_0000 + 4 * n) for n in range(2)] == [2, 2]
    bench.run_for(100 * US)
