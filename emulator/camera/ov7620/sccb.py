"""A camera's end of OmniVision's serial camera control bus (SCCB): register writes only.

CubeSense thesis, section 6.4.1, figure 6.4 and appendix C.1 (start, bytes of eight bits each
followed by one bit that the microcontroller reads as an acknowledge, stop), and OV7620 product
specifications, section 1.13: device address, register address, value. Assumptions:

- SCCB defines the ninth bit as "don't care". When addressed, this camera pulls SDA low in it, from
  the falling clock edge after the eighth bit to the next, like an I2C device.
- A register is written at the ninth clock of the third byte. Further bytes of the same
  transmission, which SCCB does not define, are ignored.
- Reading is not modelled, as the microcontroller never reads. A read address is not acknowledged.
- Clock phases that are too short for the bus are logged, and decoded nevertheless.
"""

import logging
from collections.abc import Callable

from cubestack.emulator.sim.virtual_time import PS_PER_US

logger = logging.getLogger(__name__)

SHORTEST_LOW_PS = 1_300_000  # 400 kHz bus
SHORTEST_HIGH_PS = 600_000
WRITE_BYTES = 3
BITS = 8


class SccbSlave:
    """A device on two lines, SCL and SDA, both high at first.

    Attributes:
        sda: 0 while the device pulls SDA low, else 1.
    """

    def __init__(self, address: int, write: Callable[[int, int, int], None]) -> None:
        """``write`` is called with register address, value and time in ps."""
        self._address_byte = address << 1
        self._write = write
        self._levels = {"SCL": 1, "SDA": 1}
        self._scl_since: int | None = None  # last edge since the start condition
        self._too_fast = False
        self._idle()
        self.sda = 1

    def on_pin(self, name: str, level: int, now_ps: int) -> None:
        """The master set ``name``, SCL or SDA, to ``level``; 1 means released."""
        if name not in self._levels:
            raise ValueError(f"an SCCB device has the pins SCL and SDA, not {name!r}")
        if self._levels[name] == level:
            return
        self._levels[name] = level
        if name == "SDA":
            if self._levels["SCL"]:
                self._condition(start=not level)
            return
        self._check_speed(level, now_ps)
        if self._bytes is None:
            return
        if level:
            self._bit(now_ps)
        else:
            self._after_bit()

    def _idle(self) -> None:
        self._bytes: list[int] | None = None  # of this transmission; None: not addressed, or idle
        self._shift, self._count = 0, 0

    def _condition(self, *, start: bool) -> None:
        """SDA changed while SCL was high: start or stop."""
        self._idle()
        self.sda = 1
        self._scl_since = None
        self._too_fast = False
        if start:
            self._bytes = []

    def _bit(self, now_ps: int) -> None:
        """SCL rose: a bit, or the ninth clock."""
        assert self._bytes is not None
        self._count += 1
        if self._count <= BITS:
            self._shift = self._shift << 1 | self._levels["SDA"]
        elif len(self._bytes) == WRITE_BYTES:
            self._write(self._bytes[1], self._bytes[2], now_ps)

    def _after_bit(self) -> None:
        """SCL fell: the byte is complete after eight bits, and ends after nine."""
        assert self._bytes is not None
        if self._count == BITS:
            self._bytes.append(self._shift)
            if self._bytes[0] != self._address_byte:
                self._idle()
                return
            if len(self._bytes) > WRITE_BYTES:
                logger.warning("SCCB: ignored byte %#04x after a register's value", self._shift)
            self.sda = 0
        elif self._count > BITS:
            self._shift, self._count = 0, 0
            self.sda = 1

    def _check_speed(self, level: int, now_ps: int) -> None:
        shortest = SHORTEST_LOW_PS if level else SHORTEST_HIGH_PS
        since, self._scl_since = self._scl_since, now_ps
        if since is not None and now_ps - since < shortest and not self._too_fast:
            self._too_fast = True
            logger.warning(
                "SCCB: SCL was %s for only %.2f us; at least %.1f us are needed",
                "low" if level else "high",
                (now_ps - since) / PS_PER_US,
                shortest / PS_PER_US,
            )
