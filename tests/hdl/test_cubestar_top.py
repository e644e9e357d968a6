"""The board's top on its pins, on Icarus Verilog."""

import random
import re
from pathlib import Path
from typing import Any

import pytest
from amaranth.hdl import Fragment
from amaranth.lib.wiring import Flow, SignatureMembers

from cubestack.hdl.cubestar.top import PINS, CubeStarTop

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


@pytest.fixture(scope="module")
def ports() -> SignatureMembers:
    top = CubeStarTop()
    Fragment.get(top, None)  # Amaranth warns of a component that is never elaborated
    return top.signature.members


def test_header_has_every_port_once(ports: SignatureMembers) -> None:
    assert {pin.port for pin in PINS} == {name for name in ports if not name.startswith("SRAM_")}
    positions = []
    for pin in PINS:
        first, _, last = pin.pins.partition("-")
        own = range(int(first), int(last or first) + 1)
        assert len(own) == ports[pin.port].shape
        positions += own
    assert positions == sorted(set(positions))


def test_document_has_the_same_pins(ports: SignatureMembers) -> None:
    rows = re.findall(
        r"^\| ([\d-]+) \| `(\w+)` \| (in|out) \| (.+) \|$", DOCUMENT.read_text(), re.M
    )
    directions = {Flow.In: "in", Flow.Out: "out"}
    assert rows == [
        (pin.pins, pin.port, directions[ports[pin.port].flow], pin.meaning) for pin in PINS
    ]
