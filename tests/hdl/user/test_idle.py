"""When a camera's clock has no effect on a user's design, and which strides it has."""

from collections.abc import Collection

import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.boards.gateware import idle_camera
from cubestack.emulator.rtl.wiring import Level
from cubestack.firmware_model.interface.cubesense.fpga import READ_OUTS
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.user.idle import cubes_without, prove_idle
from cubestack.hdl.user.strides import proved_strides

from .designs import WORKING, load_design

pytestmark = pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")

COLUMNS, ROWS = 16, 4

#: Designs with registers that the camera's clock moves at any time, and one of these.
RESTLESS = {"block_ram": "register", "synchronous_reset": "register"}


@pytest.mark.slow
@pytest.mark.parametrize("name", WORKING)
def test_camera_clock_is_idle_where_it_provably_has_no_effect(name: str) -> None:
    wiring = cubestar_wiring(CubeStarTop(COLUMNS, ROWS))
    (camera,) = wiring.cameras
    cubes = cubes_without(camera.name, wiring.storing)
    assert len(cubes) == 3
    design = load_design(WORKING[name], COLUMNS, ROWS)
    pins = idle_camera(wiring, camera)
    verdict = prove_idle(design, pins, cubes, {"SRAM_D_O": "SRAM_D_OE"})
    assert [*verdict.cubes] == ([] if name in RESTLESS else cubes)
    assert verdict.moves.startswith(RESTLESS.get(name, ""))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("variant", "camera"),
    [(v, n) for v in ("both-searches", "corrected", "one-search") for n in (0, 1)],
)
def test_cubesense_camera_is_idle_while_the_other_one_sends_and_stores(
    variant: str, camera: int
) -> None:
    """But for the one-search FPGA of the Sun: sending alone, it searches what it sends."""
    wiring = cubesense_wiring(CubeSensePair(READ_OUTS[variant]))
    pins = wiring.cameras[camera]

    def commanded(level: Level) -> Collection[str]:
        return wiring.storing(lambda pin: 0 if pin in wiring.acknowledges else level(pin))

    cubes = cubes_without(pins.name, commanded)
    masked = {memory["D_O"]: memory["D_OE"] for memory in wiring.memories}
    verdict = prove_idle(wiring.component, idle_camera(wiring, pins), cubes, masked)
    alone = [{"SHIFT": 1, "EDGE": 0, "RNW": 0, "SUNEN": 0, "NADEN": 1}]
    assert len(cubes) == 29
    assert verdict.refuted == (alone if (variant, camera) == ("one-search", 0) else [])
    assert len(verdict.cubes) == 29 - len(verdict.refuted)


@pytest.mark.slow
def test_storing_is_not_idle() -> None:
    wiring = cubestar_wiring(CubeStarTop(COLUMNS, ROWS))
    (camera,) = wiring.cameras
    storing, idle = {"ENABLE": 1, "RNW": 0}, {"ENABLE": 1, "RNW": 1}
    verdict = prove_idle(wiring.component, idle_camera(wiring, camera), [storing, idle], {})
    assert ([*verdict.cubes], [*verdict.refuted]) == ([idle], [storing])
    assert verdict.moves


@pytest.mark.slow
def test_strides_are_those_of_the_shipped_design_whose_proof_holds() -> None:
    shipped = CubeStarTop(COLUMNS, ROWS)
    assert proved_strides(shipped, shipped) == [*shipped.strides]
    assert proved_strides(CubeStarTop(COLUMNS // 2, 2 * ROWS), shipped) == []
    assert proved_strides(load_design(WORKING["one_process"], COLUMNS, ROWS), shipped) == []
