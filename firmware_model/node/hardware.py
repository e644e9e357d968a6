"""Peripherals of the processor that a node's program uses without a request."""

from typing import Protocol


class NodeHardware(Protocol):
    """Peripherals that every node's program uses without waiting for them."""

    def uart_send(self, data: bytes) -> None:
        """Queue ``data`` for the satellite's UART, which sends at its own pace."""

    def uart_backlog(self) -> int:
        """Number of bytes that the UART still has to send."""

    def wake(self) -> None:
        """End the current ``Sleep``, or the next one at once. For interrupt handlers."""

    def uptime_us(self) -> int:
        """Runtime in telemetry Identification, in us, read in an interrupt."""
