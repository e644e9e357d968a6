"""Peripherals of CubeSense's PIC18F45K20 that the program uses without a request.

Pins have the names of :mod:`cubestack.firmware_model.interface.cubesense.pins` and of the FPGAs'
command table (RNW, CLK, EDGE, SHIFT; SUNACK and NADACK are inputs). At reset the enables are high
and every other output is low.
"""

from enum import StrEnum
from typing import Protocol

from cubestack.firmware_model.interface.cubesense.pins import Monitor
from cubestack.firmware_model.node.hardware import NodeHardware


class Port(StrEnum):
    """A serial port; the part has only one, so one of them is in use; the model serves both."""

    NODE = "node"
    BENCH = "bench"


class CubeSenseHardware(NodeHardware, Protocol):
    """Peripherals that the program uses without waiting for them; uptime starts with each reset."""

    mcu_addressing: bool  #: the FPGAs have the option that lets the program set addresses
    serial_number: str  #: ASCII, at most 6 characters

    def uart_send(self, data: bytes, port: Port = Port.NODE) -> None:
        """Queue ``data`` for ``port``, which sends at its own pace."""

    def uart_backlog(self, port: Port = Port.NODE) -> int:
        """Number of bytes that ``port`` still has to send."""

    def adc_counts(self, monitor: Monitor) -> int:
        """Result of a conversion, 0 to 1023; the program charges its time."""
