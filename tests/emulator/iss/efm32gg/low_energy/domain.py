"""A sleeping part with the clock of its low-energy units."""

from ..bench import US, Bench, S, asleep

HZ = 32768
TICK = S // HZ + 1
PUSH_PULL, INPUT = 4, 1
PD4, PD5, PD6 = (3 * 16 + n for n in (4, 5, 6))
LEUART0 = 5
LETIMER_IRQ, BURTC_IRQ = 26, 31
NOT_PENDING = 0xE000_E280


def low(mode: int = 2, *units: str, interrupts: bool = False) -> Bench:
    """A sleeping part with LFRCO and the clocks of low-energy units."""
    bench = asleep(mode, interrupts).clock("LE", "GPIO")
    if mode != 2:
        bench.command("CMU.OSCENCMD.LFRCOEN")
        bench.run_for(200 * US)
    for unit in units:
        bench.set(f"CMU.LF{'B' if unit.startswith('LEUART') else 'A'}CLKEN0.{unit}")
    bench.run_for(4 * TICK)
    return bench
