"""Cycle costs of the ADSP-BF533: fixed point, 600 MHz, floats in software.

AraMiS thesis, sections 2.3.1 and 2.5.1 (the part), 7.3 and 8 (programs in MATLAB: no time on the
part is published, so no entry can be fitted and every duration is a prediction). Clocks are those
of the part's data sheet and of the module in the thesis' appendix A.3: core 600 MHz, system bus
120 MHz, the core clock divided by a whole number and below the bus' limit of 133 MHz.

Operations are compiled by gcc and counted on gdb's simulator, with the stalls of the processor's
pipeline (``tests/compiled_costs/blackfin.py``); program, stack and small tables are in the core's
own memory, which answers in one cycle. The thesis does not name a compiler, and two sets of
floating-point costs enclose what it can have been (switch `library`):

- ``vendor``, charged by default: sum, product and quotient of Analog Devices' run-time library as
  published; functions as newlib composes them of such operations.
- ``compiled``: gcc's library, in C, counted like the other operations.

What remains assumed is memory outside of the core, ports, and the handling of a message.

Catalogues and images are in SDRAM behind the data cache, whose lines hold 32 bytes. A line takes
about 16 bus clocks (row open, eight transfers of 32 bits as sixteen of 16 bits, the memory's
width), that is 80 core cycles; a 32-bit word that is read in sequence then costs an eighth of it.
"""

from cubestack.firmware_model.mcu.compiled import CompiledCosts, compiled_costs
from cubestack.firmware_model.mcu.costs import Cost, CostTable

CORE_HZ = 600_000_000
BUS_DIVIDER = 5
LINE_FILL_BUS_CLOCKS = 16
LINE_WORDS = 8

#: Access time of the M29W320D flash, one 16-bit word (data sheet; thesis, appendix A.2).
FLASH_READ_NS = 70
#: Bus clocks of a read on the asynchronous bus beside the access: set-up and hold (assumed).
FLASH_FRAME_BUS_CLOCKS = 2


LIBRARIES = ("vendor", "compiled")


def _vendor_costs(compiled: CompiledCosts) -> dict[str, Cost]:
    """Floating-point operations of the vendor's library, and functions composed of them."""
    library = "single precision of the Blackfin's run-time library, measured on an ADSP-BF609"
    costs = {
        "f32_add": Cost(72, "published", f"{library}: multiply and add less multiply"),
        "f32_mul": Cost(72, "published", library),
        "f32_div": Cost(251, "published", library),
        "f32_compare": Cost(30, "assumed", "library call that compares sign and magnitude"),
        "f32_convert": Cost(40, "assumed", "integer to float: library call, shift and pack"),
    }
    composed = f"{compiled.source}; its sums, products and quotients at the vendor's costs"
    for name, calls in compiled.calls.items():
        saved = sum(
            count * (compiled.operations[part] - costs[part].cycles)
            for part, count in calls.items()
        )
        costs[name] = Cost(round(compiled.operations[name] - saved), "measured", composed)
    return costs


def blackfin_bf533(*, clock_hz: int = CORE_HZ, library: str = "vendor") -> CostTable:
    """Costs in core cycles; at another clock, memory keeps its speed in bus clocks and ns.

    ``library`` is the value of the switch; raises ValueError for an unknown one.
    """
    if library not in LIBRARIES:
        raise ValueError(f"library must be {' or '.join(LIBRARIES)}, not {library!r}")
    line_fill = LINE_FILL_BUS_CLOCKS * BUS_DIVIDER
    cached = 1 + -(-line_fill // LINE_WORDS)
    access = -(-FLASH_READ_NS * (clock_hz // BUS_DIVIDER) // 1_000_000_000)
    flash = (access + FLASH_FRAME_BUS_CLOCKS) * BUS_DIVIDER
    compiled = compiled_costs("blackfin")
    operations = {name: compiled.cost(name) for name in compiled.operations}
    if library == "vendor":
        operations |= _vendor_costs(compiled)

    def assumed(cycles: int, source: str) -> Cost:
        return Cost(cycles, "assumed", source)

    return CostTable(
        name="ADSP-BF533",
        clock_hz=clock_hz,
        operations={
            **operations,
            "i2c_interrupt": operations["uart_interrupt"],
            "pixel_read": assumed(4, f"a byte of a line of 32 that takes {line_fill} to fill"),
            "ram_read": assumed(cached, f"32-bit word, an eighth of a line fill of {line_fill}"),
            "ram_write": assumed(cached, "as a read: the line is filled, then written back"),
            "flash_read": assumed(
                flash,
                f"16-bit word on the asynchronous bus, {FLASH_READ_NS} ns in whole bus clocks, "
                "set-up and hold",
            ),
            "port_read": assumed(10, "memory-mapped register across the peripheral bus"),
            "port_write": assumed(10, "memory-mapped register across the peripheral bus"),
            "host_message": assumed(800, "look-up, checks and copies of one short message"),
        },
    )


BLACKFIN_BF533 = blackfin_bf533()  #: the star tracker's processor at its highest clock
