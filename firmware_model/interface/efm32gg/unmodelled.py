"""Peripherals that the emulator does not model: registers read 0, writes are ignored.

Only those that a program is likely to access are declared, so that reports can name them.
"""

from cubestack.firmware_model.interface.efm32gg.table import Instance, Layout, peripheral


def _absent(name: str, title: str, names: str, *instances: Instance) -> Layout:
    lines = "\n".join(f"{4 * n:03X} {one} rw 00000000 *" for n, one in enumerate(names.split()))
    return peripheral(name, title, lines, *instances, modelled=False)


UNMODELLED = (
    _absent(
        "AES",
        "Encryption accelerator; chapter 38",
        "CTRL CMD STATUS IEN IF IFS IFC DATA XORDATA RESERVED0 RESERVED1 RESERVED2 "
        "KEYLA KEYLB KEYLC KEYLD KEYHA KEYHB KEYHC KEYHD",
        Instance("AES", 0x400E0000, {"AES": 36}),
    ),
    _absent(
        "LESENSE",
        "Low energy sensor interface; chapter 24",
        "CTRL TIMCTRL PERCTRL DECCTRL BIASCTRL CMD CHEN SCANRES STATUS PTR BUFDATA CURCH DECSTATE",
        Instance("LESENSE", 0x4008C000, {"LESENSE": 17}),
    ),
)
