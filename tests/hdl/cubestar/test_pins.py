"""The published board's pins: header and document."""

import re
from pathlib import Path

from cubestack.firmware_model.interface.cubestar.pins import HEADER, PUBLISHED

DOCUMENT = Path(__file__).parents[3] / "docs" / "gateware.md"


def test_header_has_every_pin_once() -> None:
    widths = {pin: pin.width for pin in PUBLISHED if not pin.startswith("SRAM_")}
    assert set(HEADER) == set(widths)
    positions = []
    for pin, position in HEADER.items():
        first, _, last = position.partition("-")
        own = range(int(first), int(last or first) + 1)
        assert len(own) == widths[pin]
        positions += own
    assert positions == sorted(set(positions))


def test_document_has_the_same_pins() -> None:
    rows = re.findall(
        r"^\| ([\d-]+) \| `(\w+)` \| (in|out) \| (.+) \|$", DOCUMENT.read_text(), re.M
    )
    assert rows == [
        (position, pin, pin.direction.removesuffix("put"), pin.meaning)
        for pin, position in HEADER.items()
    ]
