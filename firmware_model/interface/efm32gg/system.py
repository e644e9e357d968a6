"""Registers of reset, energy and watchdog: RMU, EMU, WDOG.

EFM32GG Reference Manual, chapters 9, 10 and 12.
"""

from cubestack.firmware_model.interface.efm32gg.table import Instance, peripheral

WDOG = peripheral(
    "WDOG",
    "Watchdog timer; chapter 12",
    """
    000 CTRL      rw 00000F00  EN:0 DEBUGRUN:1 EM2RUN:2 EM3RUN:3 LOCK:4 EM4BLOCK:5 SWOSCBLOCK:6
    +   PERSEL:8:4 CLKSEL:12:2
    004 CMD       w  00000000  CLEAR:0
    008 SYNCBUSY  r  00000000  CTRL:0 CMD:1
    """,
    Instance("WDOG", 0x40088000),
)

SYSTEM = (WDOG,)
