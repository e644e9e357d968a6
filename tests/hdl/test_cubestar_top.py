"""The board's top on its pins, on Icarus Verilog."""

import random
import re
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.interface.cubestar.pins import HEADER, PUBLISHED
from cubestack.hdl.cubestar.top import CubeStarTop

DOCUMENT = Path(__file__).parents[2] / "docs" / "gateware.md"

GEOMETRIES = [(8, 4), (5, 3), (16, 8)]
SEEDS = [1, 2, 3]
every_geometry = pytest.mark.parametrize(("columns", "rows"), GEOMETRIES)
every_seed = pytest.mark.parametrize("seed", SEEDS)


@every_seed
@every_geometry
def test_stores(icarus: Any, columns: int, rows: int, seed: int) -> None:
    icarus.run(CubeStarTop, columns, rows, "benches_store", seed=seed)


@every_seed
@every_geometry
def test_is_read(icarus: Any, columns: int, rows: int, seed: int) -> None:
    icarus.run(CubeStarTop, columns, rows, "benches_read", seed=seed)


@every_seed
@every_geometry
def test_changes_mode(icarus: Any, columns: int, rows: int, seed: int) -> None:
    icarus.run(CubeStarTop, columns, rows, "benches_modes", seed=seed)


@every_seed
def test_needs_no_initial_values(icarus: Any, seed: int) -> None:
    """Standby alone makes the state: the part's flip-flops come up as they like."""
    modules = ["benches_store", "benches_read", "benches_modes"]
    random.Random(seed).shuffle(modules)
    icarus.run(CubeStarTop, 5, 3, *modules, seed=seed, initialised=False)


def test_full_frame(icarus: Any) -> None:
    icarus.run(CubeStarTop, 1024, 512, "benches_full_frame", seed=1, harness="full_frame")


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
