"""Registers of the pins and of the connections between peripherals: GPIO, PRS.

EFM32GG Reference Manual, chapters 32 (GPIO) and 13 (PRS).
"""

from cubestack.firmware_model.interface.efm32gg.table import Instance, peripheral

_PORTS = "\n".join(
    f"""
    {0x24 * n:03X} P{port}_CTRL     rw 00000000  DRIVEMODE:0:2
    {0x24 * n + 0x04:03X} P{port}_MODEL    rw 00000000  MODE{{0-7}}:0:4
    {0x24 * n + 0x08:03X} P{port}_MODEH    rw 00000000  MODE{{8-15}}:0:4
    {0x24 * n + 0x0C:03X} P{port}_DOUT     rw 00000000  DOUT:0:16
    {0x24 * n + 0x10:03X} P{port}_DOUTSET  w  00000000  DOUTSET:0:16
    {0x24 * n + 0x14:03X} P{port}_DOUTCLR  w  00000000  DOUTCLR:0:16
    {0x24 * n + 0x18:03X} P{port}_DOUTTGL  w  00000000  DOUTTGL:0:16
    {0x24 * n + 0x1C:03X} P{port}_DIN      ra 00000000  DIN:0:16
    {0x24 * n + 0x20:03X} P{port}_PINLOCKN rw 0000FFFF  PINLOCKN:0:16
    """
    for n, port in enumerate("ABCDEF")
)

GPIO = peripheral(
    "GPIO",
    "General purpose input/output; chapter 32",
    f"""
    {_PORTS}
    100 EXTIPSELL  rw 00000000  EXTIPSEL0:0:3 EXTIPSEL1:4:3 EXTIPSEL2:8:3 EXTIPSEL3:12:3
    +                           EXTIPSEL4:16:3 EXTIPSEL5:20:3 EXTIPSEL6:24:3 EXTIPSEL7:28:3
    104 EXTIPSELH  rw 00000000  EXTIPSEL8:0:3 EXTIPSEL9:4:3 EXTIPSEL10:8:3 EXTIPSEL11:12:3
    +                           EXTIPSEL12:16:3 EXTIPSEL13:20:3 EXTIPSEL14:24:3 EXTIPSEL15:28:3
    108 EXTIRISE   rw 00000000  EXTIRISE:0:16
    10C EXTIFALL   rw 00000000  EXTIFALL:0:16
    110 IEN        rw 00000000  EXT:0:16
    114 IF         r  00000000  EXT:0:16
    118 IFS        w  00000000  EXT:0:16
    11C IFC        w  00000000  EXT:0:16
    120 ROUTE      rw 00000003  SWCLKPEN:0 SWDIOPEN:1 SWOPEN:3 SWLOCATION:8:2 TCLKPEN:12
    +                           TD0PEN:13 TD1PEN:14 TD2PEN:15 TD3PEN:16 ETMLOCATION:24:2
    124 INSENSE    rw 00000003  INT:0 PRS:1
    128 LOCK       rw 00000000  LOCKKEY:0:16
    12C CTRL       rw 00000000  EM4RET:0
    130 CMD        w  00000000  EM4WUCLR:0
    134 EM4WUEN    rw 00000000  EM4WUEN:0:6
    138 EM4WUPOL   rw 00000000  EM4WUPOL:0:6
    13C EM4WUCAUSE r  00000000  EM4WUCAUSE:0:6
    """,
    Instance("GPIO", 0x40006000, {"GPIO_EVEN": 1, "GPIO_ODD": 11}),
)

PRS = peripheral(
    "PRS",
    "Peripheral reflex system; chapter 13",
    """
    000   SWPULSE       w  00000000  CH{0-11}PULSE:0
    004   SWLEVEL       rw 00000000  CH{0-11}LEVEL:0
    008   ROUTE         rw 00000000  CH{0-3}PEN:0 LOCATION:8:3
    010/4 CH{0-11}_CTRL rw 00000000  SIGSEL:0:3 SOURCESEL:16:6 EDSEL:24:2 ASYNC:28
    """,
    Instance("PRS", 0x400CC000),
)

PORTS = (GPIO, PRS)
