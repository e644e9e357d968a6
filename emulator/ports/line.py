"""The host's end of a UART line: bytes from the device, each at the time of its arrival."""

from collections import deque

from cubestack.emulator.uart import Uart

__all__ = ["HostLine"]


class HostLine:
    """Plugged into a UART; the line that was there before is unplugged by that."""

    def __init__(self, uart: Uart) -> None:
        """Plug into ``uart``; what it sent before is lost, as on a wire."""
        self._uart = uart
        self._blocks: deque[tuple[bytes, int, int]] = deque()
        uart.line = self._deliver

    def arrival_ps(self, count: int = 1) -> int | None:
        """When ``count`` of the bytes not taken yet have arrived, or all if there are fewer.

        None when there are none.
        """
        arrival = None
        for data, first_ps, byte_ps in self._blocks:
            arrival = first_ps + (min(count, len(data)) - 1) * byte_ps
            count -= len(data)
            if count <= 0:
                break
        return arrival

    @property
    def write_backlog(self) -> int:
        """Bytes written that are not yet on the wire to the device."""
        return self._uart.host_backlog

    def write(self, data: bytes) -> None:
        """Start sending ``data``, behind what is still being sent."""
        self._uart.host_writes(data)

    def take(self, now_ps: int, max_bytes: int | None = None) -> bytes:
        """Bytes that have arrived by ``now_ps``, at most ``max_bytes`` of them."""
        taken = bytearray()
        while self._blocks and (max_bytes is None or len(taken) < max_bytes):
            data, first_ps, byte_ps = self._blocks[0]
            count = min(len(data), max(0, (now_ps - first_ps) // byte_ps + 1))
            if max_bytes is not None:
                count = min(count, max_bytes - len(taken))
            taken += data[:count]
            if count < len(data):
                self._blocks[0] = (data[count:], first_ps + count * byte_ps, byte_ps)
                break
            self._blocks.popleft()
        return bytes(taken)

    def unplug(self) -> None:
        """Take the plug out: what the device sends from now on is lost."""
        self._blocks.clear()
        if self._uart.line == self._deliver:
            self._uart.line = lambda _data, _first_ps, _byte_ps: None

    def _deliver(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self._blocks.append((data, first_ps, byte_ps))
