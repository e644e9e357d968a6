"""When a camera's clock has no effect on a user's design, and which strides it has."""

import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.user.idle import cubes_without, prove_idle
from cubestack.hdl.user.strides import proved_strides
from tests.tiers import quick_ones

from .designs import WORKING, load_design

pytestmark = pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")

COLUMNS, ROWS = 16, 4

#: Designs with registers that the camera's clock moves at any time, and one of these.
RESTLESS = {"block_ram": "register", "synchronous_reset": "register"}


@pytest.mark.parametrize(
    "name", quick_ones(WORKING, "generated_clock", "block_ram", "synchronous_reset")
)
def test_camera_clock_is_idle_where_it_provably_has_no_effect(name: str) -> None:
    wiring = cubestar_wiring(CubeStarTop(COLUMNS, ROWS))
    (camera,) = wiring.cameras
    cubes = cubes_without(camera.name, wiring.storing)
    assert len(cubes) == 3
    design = load_design(WORKING[name], COLUMNS, ROWS)
    verdict = prove_idle(design, camera.pins, cubes, {"SRAM_D_O": "SRAM_D_OE"})
    assert verdict.proved == (name not in RESTLESS)
    assert verdict.moves.startswith(RESTLESS.get(name, ""))


def test_storing_is_not_idle() -> None:
    wiring = cubestar_wiring(CubeStarTop(COLUMNS, ROWS))
    (camera,) = wiring.cameras
    verdict = prove_idle(wiring.component, camera.pins, [{"ENABLE": 1}], {})
    assert not verdict.proved
    assert verdict.moves


def test_strides_are_those_of_the_shipped_design_whose_proof_holds() -> None:
    shipped = CubeStarTop(COLUMNS, ROWS)
    assert proved_strides(shipped, shipped) == [*shipped.strides]
    assert proved_strides(CubeStarTop(COLUMNS // 2, 2 * ROWS), shipped) == []
    assert proved_strides(load_design(WORKING["one_process"], COLUMNS, ROWS), shipped) == []
