"""Cycle costs of the ADSP-BF533: fixed point, 600 MHz, floats in software.

AraMiS thesis, sections 2.3.1 and 2.5.1 (the part), 7.3 and 8 (programs in MATLAB: no time on the
part is published, so no entry can be fitted and every duration is a prediction). Clocks are those
of the part's data sheet and of the module in the thesis' appendix A.3: core 600 MHz, system bus
120 MHz, the core clock divided by a whole number and below the bus' limit of 133 MHz.

Catalogues and images are in SDRAM behind the data cache, whose lines hold 32 bytes. A line takes
about 16 bus clocks (row open, eight transfers of 32 bits as sixteen of 16 bits, the memory's
width), that is 80 core cycles; a 32-bit word that is read in sequence then costs an eighth of it.
"""

from cubestack.firmware_model.mcu.costs import Cost, CostTable

CORE_HZ = 600_000_000
BUS_DIVIDER = 5
LINE_FILL_BUS_CLOCKS = 16
LINE_WORDS = 8

#: Access time of the M29W320D flash, one 16-bit word (data sheet; thesis, appendix A.2).
FLASH_READ_NS = 70
#: Bus clocks of a read on the asynchronous bus beside the access: set-up and hold (assumed).
FLASH_FRAME_BUS_CLOCKS = 2


def blackfin_bf533(*, clock_hz: int = CORE_HZ) -> CostTable:
    """Costs in core cycles; at another clock, memory keeps its speed in bus clocks and ns."""
    library = "single precision of the Blackfin's run-time library, measured on an ADSP-BF609"
    core = "Blackfin Programming Reference: most instructions take one cycle"
    line_fill = LINE_FILL_BUS_CLOCKS * BUS_DIVIDER
    cached = 1 + -(-line_fill // LINE_WORDS)
    access = -(-FLASH_READ_NS * (clock_hz // BUS_DIVIDER) // 1_000_000_000)
    flash = (access + FLASH_FRAME_BUS_CLOCKS) * BUS_DIVIDER

    def published(cycles: int, source: str = library) -> Cost:
        return Cost(cycles, "published", source)

    def assumed(cycles: int, source: str) -> Cost:
        return Cost(cycles, "assumed", source)

    interrupt = assumed(120, "registers saved and restored, a byte through a queue")
    return CostTable(
        name="ADSP-BF533",
        clock_hz=clock_hz,
        operations={
            "f32_add": published(72, f"{library}: multiply and add less multiply"),
            "f32_mul": published(72),
            "f32_div": published(251),
            "f32_sqrt": assumed(500, "two divisions: Newton's method"),
            "f32_atan2": assumed(1900, "a division and a polynomial of eleven terms"),
            "f32_acos": assumed(2100, "a square root and a polynomial of eleven terms"),
            "f32_sin": assumed(1700, "range reduction and a polynomial of eleven terms"),
            "f32_compare": assumed(30, "library call that compares sign and magnitude"),
            "f32_convert": assumed(40, "integer to float: library call, shift and pack"),
            "i32_add": published(1, core),
            "i32_mul": published(5, f"{core}; a 32-bit product is three of 16 bits"),
            "i32_div": assumed(40, "library call: one DIVQ step a bit, and fix-up"),
            "table_byte": assumed(4, "address, load, use: the load is followed by a stall"),
            "pixel_read": assumed(4, f"a byte of a line of 32 that takes {line_fill} to fill"),
            "loop": published(1, "zero-overhead hardware loop, one index"),
            "call": assumed(12, "call and return empty the pipeline, four registers saved"),
            "ram_read": assumed(cached, f"32-bit word, an eighth of a line fill of {line_fill}"),
            "ram_write": assumed(cached, "as a read: the line is filled, then written back"),
            "flash_read": assumed(
                flash,
                f"16-bit word on the asynchronous bus, {FLASH_READ_NS} ns in whole bus clocks, "
                "set-up and hold",
            ),
            "port_read": assumed(10, "memory-mapped register across the peripheral bus"),
            "port_write": assumed(10, "memory-mapped register across the peripheral bus"),
            "uart_interrupt": interrupt,
            "i2c_interrupt": interrupt,
            "frame_interrupt": assumed(200, "DMA status read and cleared, the program woken"),
            "host_message": assumed(800, "look-up, checks and copies of one short message"),
            "coded_word": assumed(
                34, "64 data bits: eight table look-ups and exclusive ors, check byte, test"
            ),
            "correction": assumed(30, "one syndrome looked up, one bit flipped"),
        },
    )


BLACKFIN_BF533 = blackfin_bf533()  #: the star tracker's processor at its highest clock
