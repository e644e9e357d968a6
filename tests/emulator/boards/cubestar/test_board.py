"""The board's own knowledge; what it does as a whole is tested in tests/system."""

from collections.abc import Generator
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar import board as cubestar
from cubestack.emulator.boards.cubestar.catalogue import PAIR_LIMIT_DEG, onboard_catalogue
from cubestack.emulator.boards.cubestar.layouts import (
    BOARDS,
    CUBESTAR_POWER,
    Fpga,
    LayoutBoard,
    fpga_of,
)
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.emulator.scene.hipparcos import CATALOGUE_EPOCH
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, Kernel
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.mcu.requests import CameraTransfer, SetPin, Sleep

ENABLE_SENSOR = CameraTransfer(b"\x81\x00\x21")


def truth_of_capture(
    monkeypatch: pytest.MonkeyPatch, scene: SkyScene, enable_us: int, release_us: int
) -> np.ndarray:
    """Truth of the frame that a program stores which does nothing else."""

    class Program:
        def __init__(self, *_hardware: Any) -> None:
            pass

        def main(self) -> Generator[Any, Any, None]:
            yield ENABLE_SENSOR
            yield Sleep(enable_us, wakeable=False)
            yield SetPin("ENABLE", 1)
            yield Sleep(release_us, wakeable=False)
            yield SetPin("ENABLE", 0)
            yield Sleep(None)

    monkeypatch.setattr(cubestar, "CubeStarProgram", Program)
    board = cubestar.CubeStarBoard(scene, None)  # type: ignore[arg-type]  # nobody matches stars
    board.kernel.advance_to(PS_PER_S)
    truth = board.truth()
    board.close()
    return truth


@pytest.mark.skipif(find_compiler() is None, reason="full frames take minutes in the simulator")
def test_truth_describes_the_stored_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many frames the sensor sends before the program looks at ACK."""
    scene = SkyScene([0, 0, 0, 1], rate_deg_s=(0, 1, 0), mag_limit=-2)
    first, late, next_one = (
        truth_of_capture(monkeypatch, scene, 1000 * enable_ms, 1000 * release_ms)
        for enable_ms, release_ms in ((75, 170), (75, 500), (100, 500))
    )
    np.testing.assert_array_equal(late, first)
    # The reset value of the rate register gives 11.11 frames per second.
    assert attitude_error_deg(next_one, first)[0] == pytest.approx(1 / 11.11, rel=1e-3)


@pytest.mark.skipif(find_compiler() is None, reason="full frames take minutes in the simulator")
def test_pixels_sent_before_power_loss_are_stored(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the shared memory, which keeps its own supply; the sky is dark, the rest was random."""

    def storing() -> Generator[Any, Any, None]:
        yield ENABLE_SENSOR
        yield SetPin("ENABLE", 1)
        yield Sleep(None)

    program = SimpleNamespace(main=storing)
    monkeypatch.setattr(cubestar, "CubeStarProgram", lambda *_hardware: program)
    dark = SkyScene([0, 0, 0, 1], mag_limit=-2)
    board = cubestar.CubeStarBoard(dark, None, layout=Layout.SHARED)  # type: ignore[arg-type]
    board.kernel.advance_to(40 * PS_PER_MS)
    frame = board.camera.frame_from(0)
    board.power.switch("imager", False)
    dark_rows = board.engine.sram[: 512 * 1024].reshape(512, 1024).mean(axis=1) < 20
    board.close()
    sent = int((40 * PS_PER_MS - frame.readout_ps) / frame.line_ps)
    assert 200 < sent < 400
    # The first line is joined in its middle, so it is not there.
    assert dark_rows.tolist() == [row < sent - 1 for row in range(512)]


def test_onboard_catalogue_has_the_published_405_stars() -> None:
    listed = set(onboard_catalogue().hip.tolist())
    assert len(listed) == 405
    assert listed & {71681, 71683} == {71683}  # of alpha Centauri's stars, A alone


@pytest.mark.parametrize(("one", "other", "apart"), [(31, 401, 0.695071), (32, 92, 0.700600)])
def test_onboard_catalogue_has_the_published_star_numbers_and_distances(
    one: int, other: int, apart: float
) -> None:
    # Table 4.3, where stars are counted from 1; alpha Centauri is between stars 92 and 401.
    listed = onboard_catalogue(epoch=CATALOGUE_EPOCH)
    first, second = listed.vectors[[one - 1, other - 1]].astype(float)
    assert np.arccos(first @ second) == pytest.approx(apart, abs=1e-6)


def test_lists_every_pair_within_a_field() -> None:
    x, y = LENS.columns - 0.5, LENS.rows - 0.5
    corners = LENS.unproject(np.array([[-0.5, -0.5], [x, -0.5], [-0.5, y], [x, y]]))
    diagonal = np.degrees(np.arccos(np.clip(corners @ corners.T, -1, 1))).max()
    assert diagonal < PAIR_LIMIT_DEG == pytest.approx(diagonal, abs=0.1)


def test_compiling_twice_gives_the_same_file() -> None:
    first, again = onboard_catalogue(3.0), onboard_catalogue.__wrapped__(3.0)
    assert first is not again
    np.testing.assert_array_equal(first.vectors, again.vectors)
    np.testing.assert_array_equal(first.pairs.angle, again.pairs.angle)


FPGA = CUBESTAR_POWER.parts["fpga"].ma
SRAM = CUBESTAR_POWER.parts["memory"].ma
REST = 14.0 + 2.4 + 42.8
"""LEDs, processor asleep, imager disabled: table 6.2 less FPGA board and memory."""


def current_ma(board: LayoutBoard, pins: dict[str, int], accessed: bool) -> float:
    model = PowerModel(Kernel(), board.power)
    for part, state in board.states(pins, accessed).items():
        model.set_state(part, state)
    return model.current_ma()


def settings(board: LayoutBoard) -> list[dict[str, int]]:
    names = board.controls
    return [dict(zip(names, levels, strict=True)) for levels in product((0, 1), repeat=len(names))]


@pytest.mark.parametrize(
    ("enable", "rnw", "fpga", "memory"),
    [
        (0, 0, "standby", "standby"),
        (0, 1, "standby", "standby"),
        (1, 0, "storing", "standby"),
        (1, 1, "reading", "transfer"),
    ],
)
@pytest.mark.parametrize("accessed", [False, True])
def test_published_layout_draws_current_by_fpga_and_memory_state(
    enable: int, rnw: int, fpga: str, memory: str, accessed: bool
) -> None:
    board = BOARDS[Layout.COPIED]
    found = current_ma(board, {"ENABLE": enable, "RNW": rnw}, accessed)
    assert found == pytest.approx(REST + FPGA[fpga] + SRAM[memory])


@pytest.mark.parametrize(
    ("layout", "boards", "memories"),
    [(Layout.SHARED, 1, 1), (Layout.TWO_MEMORIES, 1, 2), (Layout.TWO_BOARDS, 2, 2)],
)
@pytest.mark.parametrize("accessed", [False, True])
def test_other_layouts_add_the_currents_of_fpgas_and_memories(
    layout: Layout, boards: int, memories: int, accessed: bool
) -> None:
    """A published FPGA board has an SRAM in it, idle by standby and used else."""
    board = BOARDS[layout]
    assert len(board.boards) == boards
    alone = {
        state: ma - SRAM["standby" if state == "standby" else "transfer"]
        for state, ma in FPGA.items()
    }
    for pins in settings(board):
        stores = [pins[f"{name}ENABLE"] and not pins[f"{name}RNW"] for name in board.boards]
        storing = sum(map(bool, stores))
        assert board.storing(pins) == storing
        # Who stores is not accessed, unless there is another memory.
        reading = int(accessed and storing < memories)
        reads = int(accessed and storing < boards)
        if layout is Layout.SHARED and storing and accessed:
            continue  # the program never does
        expected = REST + storing * alone["storing"] + reads * alone["reading"]
        expected += (boards - storing - reads) * alone["standby"]
        used = storing + reading
        expected += used * SRAM["transfer"] + (memories - used) * SRAM["standby"]
        assert current_ma(board, pins, accessed) == pytest.approx(expected)


def test_two_memories_at_one_fpga_exceed_its_pins() -> None:
    """Pins and tiles of the AGLN030: 77 and 768 (IGLOO nano handbook)."""
    for layout in Layout:
        fpga = fpga_of(layout)
        assert (fpga.part_pins, fpga.part_tiles) == (77, 768)
        assert fpga.fits is (layout is not Layout.TWO_MEMORIES)
        assert (fpga.pins > 77) is (layout is Layout.TWO_MEMORIES)


@pytest.mark.parametrize(
    ("pins", "tiles", "fits"), [(77, 768, True), (78, 768, False), (77, 769, False), (1, 1, True)]
)
def test_design_fits_only_within_the_pins_and_tiles_of_the_part(
    pins: int, tiles: int, fits: bool
) -> None:
    assert Fpga(pins, tiles, 77, 768).fits is fits
