"""Where a development board is: ``board:PORT[,PORT2][@BAUD]``."""

from dataclasses import dataclass

from cubestack.firmware_model.interface.devboard.table import BAUD

PREFIX = "board:"

FORM = f"{PREFIX}PORT[,PORT2][@BAUD]"


@dataclass(frozen=True)
class BoardAddress:
    """Ports of the boards, as pyserial opens them: a device file, or ``socket://HOST:PORT``."""

    ports: tuple[str, ...]
    baud: int = BAUD

    def __str__(self) -> str:
        rate = "" if self.baud == BAUD else f"@{self.baud}"
        return f"{PREFIX}{','.join(self.ports)}{rate}"


def parse_address(text: str) -> BoardAddress:
    """ValueError for a text that is no address; it names the form."""
    ports, at, rate = text.removeprefix(PREFIX).rpartition("@")
    if not at or not rate.isdecimal():
        ports, rate = text.removeprefix(PREFIX), str(BAUD)
    parts = tuple(ports.split(","))
    if not text.startswith(PREFIX) or not all(parts) or not int(rate):
        raise ValueError(f"{text!r} names no board; the form is {FORM}, as {PREFIX}/dev/ttyUSB1")
    if len(parts) > 2:
        raise ValueError(f"{text!r} names {len(parts)} ports; at most two boards are one device")
    return BoardAddress(parts, int(rate))
