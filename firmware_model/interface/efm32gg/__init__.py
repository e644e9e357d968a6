"""Registers of the EFM32GG280F1024, the source of simulator, C header and traces."""

from cubestack.firmware_model.interface.efm32gg.aes import AES
from cubestack.firmware_model.interface.efm32gg.analog import ANALOG
from cubestack.firmware_model.interface.efm32gg.lesense import LESENSE
from cubestack.firmware_model.interface.efm32gg.ports import PORTS
from cubestack.firmware_model.interface.efm32gg.serial import SERIAL
from cubestack.firmware_model.interface.efm32gg.system import CLOCKS, SYSTEM
from cubestack.firmware_model.interface.efm32gg.table import Instance, Layout, Register
from cubestack.firmware_model.interface.efm32gg.timers import TIMERS
from cubestack.firmware_model.interface.efm32gg.transfers import DMA, EXTERNAL_BUS
from cubestack.firmware_model.interface.efm32gg.values import with_values

#: All kinds of peripherals of the part.
LAYOUTS: tuple[Layout, ...] = with_values(
    (*(*SYSTEM, *CLOCKS, *PORTS, *EXTERNAL_BUS), *(*SERIAL, *TIMERS, *ANALOG, LESENSE, DMA, AES))
)


def register_at(address: int) -> tuple[Instance, Register] | None:
    """The register at ``address`` and its peripheral, or None."""
    for layout in LAYOUTS:
        for instance in layout.instances:
            for register in layout.registers:
                if instance.base + register.offset == address & ~3:
                    return instance, register
    return None
