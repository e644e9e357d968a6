"""Cycle costs of the PIC18F45K20: 5 million instructions per second.

CubeSense thesis, section 3.2.2 (the part), 6.1.1 (Microchip's C18 compiler, an int takes twice a
char) and 7.4 (the timer's formula, hence the instruction clock). No figures of C18's library are
published. Addition and division are those of Microchip's application note AN575, which states the
maximum of each; multiplication uses the part's own multiplier, which AN575 does not use; functions
are composed of the three, as in the usual algorithms. Nothing here is fitted to a published time,
and floating-point times are rather upper bounds.
"""

from cubestack.firmware_model.mcu.costs import Cost, CostTable

INSTRUCTION_HZ = 5_000_000

#: Maximum cycles of the 32-bit routines in Microchip's application note AN575.
ADD, DIVIDE = 271, 971

#: Nine 8 x 8 bit products of the mantissas, each fetched, multiplied (MULWF) and added in 8 cycles;
#: signs, exponents, rounding, arguments and result are assumed. AN575 needs 591, bit by bit.
MULTIPLY = 9 * 8 + 128


def pic18f45k20() -> CostTable:
    survey = "routines on a PIC18 as compiled by sdcc"
    core = "PIC18 instruction set: bit set, bit clear and move, with their bank"
    note = "Microchip AN575, at most"

    def published(cycles: int) -> Cost:
        return Cost(cycles, "published", note)

    def composed(additions: int, multiplications: int, divisions: int, rest: int, how: str) -> Cost:
        cycles = additions * ADD + multiplications * MULTIPLY + divisions * DIVIDE + rest
        parts = f"{additions} additions, {multiplications} products, {divisions} quotients"
        return Cost(cycles, "assumed", f"{how}: {parts} as above, and {rest} cycles")

    def measured(cycles: int) -> Cost:
        return Cost(cycles, "measured", survey)

    arc = composed(5, 4, 3, 1073, "reduction and a quotient of polynomials; the rest as in sdcc's")
    port = Cost(2, "measured", f"{survey}; {core}")
    strobe = 2 * port.cycles + port.cycles  # clock up, read, clock down
    array, loop, loop16, signed_loop = 18, 7, 14, 22
    interrupt = Cost(150, "assumed", "C18 saves and restores its temporary data; a byte queued")
    return CostTable(
        name="PIC18F45K20",
        clock_hz=INSTRUCTION_HZ,
        operations={
            "f32_add": published(ADD),
            "f32_mul": Cost(
                MULTIPLY, "assumed", "nine products of the part's 8 x 8 bit multiplier"
            ),
            "f32_div": published(DIVIDE),
            "f32_sqrt": composed(3, 2, 2, 488, "two of Newton's steps; the rest as in sdcc's"),
            "f32_atan2": arc,
            "f32_tan": Cost(arc.cycles, "assumed", "as long as the arc tangent"),
            "f32_compare": Cost(60, "assumed", "a call; signs, then four bytes one by one"),
            "f32_convert": Cost(120, "assumed", "a call; an int shifted bit by bit, 7 each"),
            "i8": Cost(4, "assumed", "load, operate, test and branch, or store"),
            "i16_add": Cost(12, "assumed", "half of 32 bits; addition, shift or comparison"),
            "i16_div": Cost(350, "assumed", "a quarter of 32 bits: long division"),
            "table_byte": measured(19),
            "array_byte": Cost(
                array, "assumed", "an int added to an array's place on the stack: FSR, both bytes"
            ),
            "loop": measured(loop),
            "loop16": Cost(loop16, "assumed", "an int counter takes twice a char (section 6.1.1)"),
            "call": Cost(20, "assumed", "call, return, arguments on the software stack"),
            "port_read": port,
            "port_write": port,
            "strobe_byte": Cost(
                strobe + loop16, "assumed", "clock up, read, clock down, and an int counted"
            ),
            "scan_byte": Cost(
                strobe + signed_loop + array,
                "assumed",
                "as strobe_byte, with a counter that is compared with its sign, and stored in an "
                "array on the stack (appendix C.3)",
            ),
            "address_byte": Cost(
                (3 * 3 + 4) * port.cycles + strobe + loop16 + 2 * 12,
                "assumed",
                "row and column put together, sent as three bytes with a clock each; the mode and "
                "the data lines' direction changed, and back; then a read",
            ),
            "adc_conversion": Cost(
                120, "assumed", "acquisition of 5 us and 12 periods of 1.6 us, with a wait"
            ),
            "uart_interrupt": interrupt,
            "i2c_interrupt": interrupt,
            "host_message": Cost(1500, "assumed", "look-up, checks and copies of a short message"),
        },
    )


PIC18F45K20 = pic18f45k20()
