"""Cycle costs of the PIC18F45K20.

CubeSense thesis, sections 3.2.2 (the part), 6.1.1 (Microchip's C18 compiler) and 7.4 (the timer).

Operations are compiled by sdcc and counted on a simulator (``tests/compiled_costs``). No cycles of
C18's floating-point library are published, so two sets of costs enclose it, and every time of this
processor is a range between them (switch `library`):

- ``notes``, charged by default, as they are C18's maker's: the routines in assembler of Microchip's
  application note AN575, at most, with the mantissas' product by the part's 8 x 8 bit multiplier,
  which AN575 does not use (it takes 591 cycles). Functions are composed of them, as in the usual
  algorithms.
- ``compiled``: sdcc's library, written in C, counted like the other operations.

Nothing here is fitted to a published time.

Section 7.4 prints a timer's formula with F_OSC of 5 MHz. Here 5 MHz is the rate of instructions
(switch `clock`, ``instructions``): the thesis' oscilloscope, which needs no formula, agrees with
its timer within a millisecond. ``oscillator`` is the formula to the letter: a PIC18 executes one
instruction in four clocks of its oscillator, so every time of the program is four times as long.
"""

from functools import cache

from cubestack.firmware_model.mcu.compiled import compiled_costs
from cubestack.firmware_model.mcu.costs import Cost, CostTable

#: Instructions per second, by the value of switch `clock`.
CLOCKS = {"instructions": 5_000_000, "oscillator": 5_000_000 // 4}

LIBRARIES = ("notes", "compiled")

#: Most cycles of a 32-bit addition, quotient and conversion in AN575.
ADD, DIVIDE, CONVERT = 271, 971, 114

#: Nine 8 x 8 bit products of the mantissas, each fetched, multiplied (MULWF) and added in 8 cycles;
#: signs, exponents, rounding, arguments and result are assumed.
MULTIPLY = 9 * 8 + 128


def notes_costs() -> dict[str, Cost]:
    """Floating-point operations by Microchip's application note."""

    def published(cycles: int) -> Cost:
        return Cost(cycles, "published", "Microchip AN575, at most")

    def composed(additions: int, multiplications: int, divisions: int, rest: int, how: str) -> Cost:
        cycles = additions * ADD + multiplications * MULTIPLY + divisions * DIVIDE + rest
        parts = f"{additions} additions, {multiplications} products, {divisions} quotients"
        return Cost(cycles, "assumed", f"{how}: {parts} as above, and {rest} cycles")

    arc = composed(5, 4, 3, 1073, "reduction and a quotient of polynomials; the rest as in sdcc's")
    return {
        "f32_add": published(ADD),
        "f32_mul": Cost(MULTIPLY, "assumed", "nine products of the part's 8 x 8 bit multiplier"),
        "f32_div": published(DIVIDE),
        "f32_sqrt": composed(3, 2, 2, 488, "two of Newton's steps; the rest as in sdcc's"),
        "f32_atan2": arc,
        "f32_tan": Cost(arc.cycles, "assumed", "as long as the arc tangent"),
        "f32_compare": Cost(60, "assumed", "a call; signs, then four bytes one by one"),
        "f32_convert": published(CONVERT),
    }


@cache
def pic18f45k20(*, library: str = "notes", clock: str = "instructions") -> CostTable:
    """The table by the values of switches `library` and `clock`; ValueError for unknown ones."""
    if library not in LIBRARIES or clock not in CLOCKS:
        raise ValueError(
            f"costs are {' or '.join(LIBRARIES)} and the clock {' or '.join(CLOCKS)}, not "
            f"{library!r} and {clock!r}"
        )
    compiled = compiled_costs("pic18")
    operations = {name: compiled.cost(name) for name in compiled.operations if name != "interrupt"}
    if library == "notes":
        operations |= notes_costs()
    interrupt = compiled.cost("interrupt")
    operations |= {
        "uart_interrupt": interrupt,
        "i2c_interrupt": interrupt,
        "adc_conversion": Cost(
            120, "assumed", "acquisition of 5 us and 12 periods of 1.6 us at 5 MHz, with a wait"
        ),
        "host_message": Cost(1500, "assumed", "look-up, checks and copies of a short message"),
    }
    return CostTable(name="PIC18F45K20", clock_hz=CLOCKS[clock], operations=operations)


PIC18F45K20 = pic18f45k20()
