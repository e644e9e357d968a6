"""Registers of the EFM32GG280F1024, the source of simulator, C header and traces."""

from cubestack.firmware_model.interface.efm32gg.aes import AES
from cubestack.firmware_model.interface.efm32gg.analog import ANALOG
from cubestack.firmware_model.interface.efm32gg.ports import PORTS
from cubestack.firmware_model.interface.efm32gg.serial import SERIAL
from cubestack.firmware_model.interface.efm32gg.system import CLOCKS, SYSTEM
from cubestack.firmware_model.interface.efm32gg.table import Instance, Layout, Register, peripheral
from cubestack.firmware_model.interface.efm32gg.timers import TIMERS
from cubestack.firmware_model.interface.efm32gg.transfers import DMA, EXTERNAL_BUS


def _absent(name: str, title: str, names: str, *instances: Instance) -> Layout:
    lines = "\n".join(f"{4 * n:03X} {one} rw 00000000 *" for n, one in enumerate(names.split()))
    return peripheral(name, title, lines, *instances, modelled=False)


#: Peripherals that the emulator does not model: registers read 0, writes are ignored. Only those
#: that a program is likely to access are declared, so that reports can name them.
_UNMODELLED = (
    _absent(
        "LESENSE",
        "Low energy sensor interface; chapter 24",
        "CTRL TIMCTRL PERCTRL DECCTRL BIASCTRL CMD CHEN SCANRES STATUS PTR BUFDATA CURCH DECSTATE",
        Instance("LESENSE", 0x4008C000, {"LESENSE": 17}),
    ),
)

#: All kinds of peripherals of the part.
LAYOUTS: tuple[Layout, ...] = (
    *(*SYSTEM, *CLOCKS, *PORTS, *EXTERNAL_BUS),
    *(*SERIAL, *TIMERS, *ANALOG, DMA, AES),
    *_UNMODELLED,
)


def register_at(address: int) -> tuple[Instance, Register] | None:
    """The register at ``address`` and its peripheral, or None."""
    for layout in LAYOUTS:
        for instance in layout.instances:
            for register in layout.registers:
                if instance.base + register.offset == address & ~3:
                    return instance, register
    return None
