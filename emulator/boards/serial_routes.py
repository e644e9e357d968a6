"""Serial blocks of a processor led to ports: ``uart0@PE0,PE1:PATH``.

EFM32GG Reference Manual, sections 17.3 and 19.3: LOCATION of a block's ROUTE register selects the
pins of all its signals at once.
"""

import re
from dataclasses import dataclass

from cubestack.firmware_model.interface.efm32gg.pins import (
    PINS,
    SERIAL_UNITS,
    pin_number,
    serial_locations,
)

FORM = "BLOCK@TX,RX[:PATH|PORT]"

_NEXT = re.compile(r",(?=\s*[A-Za-z]+[0-9]@)")
_ROUTE = re.compile(r"\s*([A-Za-z]+[0-9])@(\w+),(\w+)(?::(.+))?")


@dataclass(frozen=True)
class SerialRoute:
    """A serial block at one of its locations.

    Attributes:
        block: in small letters, as ``uart0``; the name of its line.
        tx, rx: pins, port times 16 plus bit.
        place: path of a pseudo-terminal, or number of a TCP port, to which it leads; empty: beside
            the port of the board's first line.
    """

    block: str
    tx: int
    rx: int
    place: str = ""

    def __str__(self) -> str:
        return f"{self.block}@{PINS[self.tx]},{PINS[self.rx]}"


def parse_routes(text: str) -> tuple[SerialRoute, ...]:
    """The routes in ``text``, separated by commas; ValueError for one that the part lacks."""
    return tuple(map(_parse, _NEXT.split(text))) if text else ()


def _parse(text: str) -> SerialRoute:
    found = _ROUTE.fullmatch(text)
    if found is None:
        raise ValueError(f"serial {text!r} must be {FORM}, such as uart0@PE0,PE1:./tty")
    block, *pins, place = found.groups(default="")
    if block.upper() not in SERIAL_UNITS:
        known = ", ".join(SERIAL_UNITS).lower()
        raise ValueError(f"serial {text!r}: the part has no {block!r}; it has {known}")
    tx, rx = (pin_number(pin.upper()) for pin in pins)
    locations = serial_locations(block.upper())
    if (tx, rx) not in locations:
        known = " or ".join(f"{PINS[tx]},{PINS[rx]}" for tx, rx in locations)
        raise ValueError(f"serial {text!r}: TX,RX of {block} are {known}")
    return SerialRoute(block.lower(), tx, rx, place)
