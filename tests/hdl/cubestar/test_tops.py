"""CubeStar's tops on their pins, on Icarus Verilog; and the published pins in their documents."""

import random
import re
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.interface.cubestar.pins import HEADER, PUBLISHED
from cubestack.hdl.contract.cubestar.declared import FULL_FRAME
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.generate import verilog_text
from tests.hdl.cubestar.as_published import AsPublished, DoubleAsPublished, SharedAsPublished
from tests.hdl.regression import FULL, STAR, TIERS, modules
from tests.tiers import quick

SIZES = [(5, 3), (8, 4), (16, 8)]
SEEDS = (1, 2, 3) if FULL else (1,)
SIZED_SEEDS = quick([(*size, seed) for seed in SEEDS for size in SIZES], 1)
STORING = modules(STAR, "store", "borders")
NEXT_VERSION = ["cubestar-shared", "cubestar-double", "cubestar-boards"]


@pytest.mark.parametrize(("columns", "rows", "seed"), SIZED_SEEDS)
def test_published_gateware_passes_its_testbenches(
    icarus: Any, columns: int, rows: int, seed: int
) -> None:
    names = modules(STAR, "store", "read", "modes", *["borders"] * (columns == 5))
    icarus.run(CubeStarTop, columns, rows, *names, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_published_needs_no_initial_values(icarus: Any, seed: int) -> None:
    """Standby alone sets the state: the part's flip-flops power up at any level."""
    shuffled = [*modules(STAR, "store", "read", "modes")]
    random.Random(seed).shuffle(shuffled)
    icarus.run(CubeStarTop, 5, 3, *shuffled, seed=seed, initialised=False)


@pytest.mark.skipif(not FULL, reason="make test-hdl; here tests/emulator/rtl/test_icarus.py")
def test_store_and_read_of_a_full_frame_pass_the_testbench(icarus: Any) -> None:
    icarus.run(CubeStarTop, 1024, 512, *modules(STAR, "full_frame"), seed=1, harness=FULL_FRAME)


@pytest.mark.parametrize(("columns", "rows", "seed"), quick([(5, 3, 2), (8, 4, 1), (32, 16, 3)], 1))
@pytest.mark.parametrize("top", quick(NEXT_VERSION, 1))
def test_gateware_versions_with_a_bus_pass_their_testbenches(
    icarus: Any, top: str, columns: int, rows: int, seed: int
) -> None:
    tier = TIERS[top]
    on_bus = [name for name in tier.modules if not name.endswith("states")]
    icarus.run(tier.design, columns, rows, *on_bus, seed=seed, environment=tier.further)


@pytest.mark.slow
@pytest.mark.parametrize("top", NEXT_VERSION)
def test_bus_needs_no_initial_values(icarus: Any, top: str) -> None:
    tier = TIERS[top]
    settings = {"environment": tier.further, "initialised": False}
    icarus.run(tier.design, 5, 3, *modules(STAR, "bus"), seed=1, **settings)


def with_board(wrapper: AsPublished, name: str) -> str:
    board = wrapper.design(wrapper.columns, wrapper.rows)
    return verilog_text(wrapper, name) + verilog_text(board, "board")


@pytest.mark.slow
@pytest.mark.parametrize(("columns", "rows", "seed"), [(5, 3, 1), (8, 4, 2)])
@pytest.mark.parametrize("wrapper", [SharedAsPublished, DoubleAsPublished])
def test_new_gateware_version_passes_the_published_store_testbenches(
    icarus: Any, wrapper: type[AsPublished], columns: int, rows: int, seed: int
) -> None:
    icarus.run(wrapper, columns, rows, *STORING, seed=seed, text=with_board)


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


def test_documentation_lists_every_header_pin() -> None:
    text = (Path(__file__).parents[3] / "docs" / "sensors" / "gateware.md").read_text()
    rows = re.findall(r"^\| ([\d-]+) \| `(\w+)` \| (in|out) \| (.+) \|$", text, re.M)
    assert rows == [
        (position, pin, pin.direction.removesuffix("put"), pin.meaning)
        for pin, position in HEADER.items()
    ]
