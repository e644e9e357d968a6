"""Cycle costs of CubeStar's EFM32GG: Cortex-M3, no floating point unit, 48 MHz.

CubeStar thesis, section 3.2 (the part). The transfer loop is the only entry that was fitted to a
published duration (table 6.2). Of that table capture and processing alone is a prediction: the
discard delay is a setting, and idle is what is left of the second.
"""

from cubestack.firmware_model.mcu.costs import Cost, CostTable


def cortex_m3(
    *, clock_hz: int = 48_000_000, flash_waits: int = 2, ebi_waits: int = 6, gpio_waits: int = 0
) -> CostTable:
    """Costs of the EFM32GG's Cortex-M3 with software floating point.

    Args:
        clock_hz: core clock in Hz.
        flash_waits: wait states of a data read from flash. The vendor's clock driver sets none up
            to 16 MHz, one up to 32 MHz and two above. Instruction fetches are taken as hidden by
            the prefetcher and the cache.
        ebi_waits: cycles of one transaction on the External Bus Interface beyond the load or store
            itself (address latch, set-up, strobe); assumed, the thesis prints no timing registers.
        gpio_waits: extra cycles of one access to a GPIO register.
    """
    survey = "soft-float and integer routines on a Cortex-M3, flash at zero wait states"
    core = "Cortex-M3 Technical Reference Manual, instruction timing: load or store, 2 cycles"
    flash = " as the part's family takes; the program waits, interrupts are served"

    def measured(cycles: int) -> Cost:
        return Cost(cycles, "measured", survey)

    ebi = Cost(2 + ebi_waits, "assumed", f"load or store of 2 cycles + {ebi_waits} on the bus")
    interrupt = Cost(80, "assumed", "entry and exit of 12 cycles each, a byte through a queue")
    return CostTable(
        name="EFM32GG Cortex-M3",
        clock_hz=clock_hz,
        operations={
            "f32_add": measured(61),
            "f32_mul": measured(46),
            "f32_div": measured(148),
            "f32_sqrt": measured(369),
            "f32_atan2": measured(1881),
            "f32_acos": measured(1451),
            "f32_sin": Cost(1451, "assumed", "sine or cosine: as long as the arc cosine"),
            "f32_compare": Cost(25, "assumed", "library call that compares sign and magnitude"),
            "f32_convert": Cost(30, "assumed", "integer to float: library call, shift and pack"),
            "i32_add": measured(4),
            "i32_mul": measured(4),
            "i32_div": measured(11),
            "table_byte": measured(9),
            "loop": measured(5),
            "call": Cost(16, "assumed", "branch and link, four registers saved and restored"),
            "ram_read": Cost(2, "published", core),
            "ram_write": Cost(2, "published", core),
            "flash_read": Cost(2 + flash_waits, "published", f"{core}, + {flash_waits} waits"),
            "flash_erase": Cost(clock_hz // 50, "assumed", f"page, 20 ms{flash}"),
            "flash_program": Cost(clock_hz // 50_000, "assumed", f"word, 20 us{flash}"),
            "ebi_read": ebi,
            "ebi_write": ebi,
            "port_read": measured(3 + gpio_waits),
            "port_write": measured(2 + gpio_waits),
            "uart_interrupt": interrupt,
            "i2c_interrupt": interrupt,
            "host_message": Cost(600, "assumed", "look-up, checks and copies of one short message"),
            "transfer_byte": Cost(
                37,
                "fitted",
                "whole turn of the FPGA-to-SRAM copy loop: CubeStar thesis, Table 6.2, "
                "404 ms for 524 288 bytes at 48 MHz",
            ),
        },
    )


CORTEX_M3 = cortex_m3()
"""The processor of CubeStar as the thesis runs it (section 3.2): 48 MHz."""
