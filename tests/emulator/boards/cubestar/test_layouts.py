"""Currents of the layouts, derived from the parts of the published board."""

from itertools import product

import pytest

from cubestack.emulator.boards.cubestar.layouts import (
    BOARDS,
    CUBESTAR_POWER,
    Fpga,
    LayoutBoard,
    fpga_of,
)
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.cubestar.pins import Layout

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
def test_the_published_board(enable: int, rnw: int, fpga: str, memory: str, accessed: bool) -> None:
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
def test_a_design_fits_up_to_the_last_pin_and_tile(pins: int, tiles: int, fits: bool) -> None:
    assert Fpga(pins, tiles, 77, 768).fits is fits
