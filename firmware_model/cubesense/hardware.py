"""What CubeSense's program sees of its PIC18F45K20 beside the requests that take time.

Pins have the names of :mod:`cubestack.firmware_model.interface.cubesense.pins` and of the FPGAs'
command table (RNW, CLK, EDGE, SHIFT; SUNACK and NADACK are inputs). At reset the enables are high
and every other output is low.
"""

from enum import StrEnum
from typing import Protocol

from cubestack.firmware_model.interface.cubesense.pins import Monitor
from cubestack.firmware_model.node.hardware import NodeHardware


class Port(StrEnum):
    """A serial port; the part has one, so either is in use, and the model serves both."""

    NODE = "node"
    BENCH = "bench"


class CubeSenseHardware(NodeHardware, Protocol):
    """Peripherals that the program uses without waiting for them; uptime starts with each reset.

    Attributes:
        mcu_addressing: the FPGAs are built with the option that lets the program choose addresses.
        serial_number: ASCII, at most 6 characters.
    """

    mcu_addressing: bool
    serial_number: str

    def uart_send(self, data: bytes, port: Port = Port.NODE) -> None:
        """Queue ``data`` for ``port``; the peripheral sends at its own pace."""

    def uart_backlog(self, port: Port = Port.NODE) -> int:
        """Bytes that ``port`` still has to send."""

    def adc_counts(self, monitor: Monitor) -> int:
        """Result of a conversion, 0 to 1023; the program charges its time."""
