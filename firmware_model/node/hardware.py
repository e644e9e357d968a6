"""What a node's program sees of its processor beside the requests that take time."""

from typing import Protocol


class NodeHardware(Protocol):
    """Peripherals that every node's program uses without waiting for them."""

    def uart_send(self, data: bytes) -> None:
        """Queue ``data`` for the satellite's UART; the peripheral sends at its own pace."""

    def uart_backlog(self) -> int:
        """Bytes that the UART still has to send."""

    def wake(self) -> None:
        """End the running ``Sleep``, or the next one at once. For interrupt handlers."""

    def uptime_us(self) -> int:
        """What telemetry Identification calls runtime, in us, read in an interrupt."""
