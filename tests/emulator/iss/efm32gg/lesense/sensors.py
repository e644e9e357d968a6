"""LESENSE with its comparators, set up as the tests of its parts need it."""

from ..bench import MS, Bench, S, asleep, mask_of

LF_HZ, AUX_HZ, CORE_HZ = 32_768, 14_000_000, 14_000_000
CYCLE_PS = S // CORE_HZ + 1
"""Resolution of the times of pins in EM1."""
IRQ, DMA_SOURCE = 17, 50
PERIODIC, ONE_SHOT, BY_PRS = range(3)
DIRECT, INVERSE, TOGGLE, BY_DECODER = range(4)
LEVEL, POSITIVE, NEGATIVE = 1, 2, 3
HIGH, LOW = 1, 2
START, STOP, DECODE, CLEAR = 1, 2, 4, 8
GE, DECODED, STORED, INVERTED = 1 << 16, 1 << 17, 1 << 18, 1 << 19
BY_LEVEL, EXCLK, SAMPLECLK, ALTEX = 1 << 12, 1 << 17, 1 << 18, 1 << 19
MUX, MUX_THRESHOLD = 1, 2
COMPLETE = mask_of("LESENSE.IF.SCANCOMPLETE")
VDD, INPUTS = 9, 10
SUPPLY_V = 3.3
PUSH_PULL = 4


def setif(when: int) -> int:
    return when << 13


def exmode(how: int) -> int:
    return how << 15


def lf_ps(cycles: float) -> int:
    return round(cycles * S / LF_HZ)


def lesense(mode: int = 1, **registers: int) -> Bench:
    """LESENSE on LFRCO; the comparators' inputs against half of the supply (level 32 of 63)."""
    bench = asleep(mode).clock("LE", "ACMP0", "ACMP1", "GPIO", "PRS", "DAC0")
    if mode == 1:
        bench.command("CMU.OSCENCMD.LFRCOEN")
    bench.machine.analog[VDD] = SUPPLY_V
    bench.load("CMU", LFCLKSEL=5, LFACLKEN0=1)
    for unit in ("ACMP0", "ACMP1"):
        bench.load(unit, INPUTSEL=10 << 4 | 32 << 8)
    bench.run_for(2 * MS)
    registers = {"PERCTRL": MUX << 20 | MUX << 22, **registers}
    bench.load("LESENSE", **registers)
    bench.run_for(MS)
    assert not bench["LESENSE.SYNCBUSY"]
    bench.log()
    return bench


def configure(bench: Bench, number: int, **registers: int) -> None:
    for name, value in registers.items():
        bench[f"LESENSE.CH{number}_{name}"] = value


def volts(bench: Bench, channel: int, value: float) -> None:
    bench.machine.analog[INPUTS + channel] = value
    bench.machine.analog_changed()


def scan(bench: Bench, most_ps: int = 10 * MS) -> None:
    """One scan, by command."""
    bench.load("LESENSE", IFC=0x7F_FFFF, CMD=START)
    bench.run_for(most_ps)
    assert bench.is_set("LESENSE.IF.SCANCOMPLETE")


def by_level(channels: int = 0xFFFF, **registers: int) -> Bench:
    """One-shot scans of comparator levels."""
    bench = lesense(CTRL=ONE_SHOT | registers.pop("control", 0), CHEN=channels, **registers)
    for number in range(16):
        configure(bench, number, INTERACT=BY_LEVEL)
    return bench
