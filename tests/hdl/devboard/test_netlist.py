"""Placed netlists: the models of cells, and whole boards against the reference model."""

import itertools
from pathlib import Path
from random import Random

import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.board_model.netlist_board import netlist_board
from cubestack.emulator.rtl.devboard.lines import lines_of
from cubestack.firmware_model.interface.devboard import Frame, encode_frame
from cubestack.hdl.devboard.bitstream import BITSTREAM, build
from cubestack.hdl.devboard.boards import BOARDS
from cubestack.hdl.devboard.bridge import BridgeTiming
from cubestack.hdl.devboard.netlist import MUTANTS, FlipFlop, Lut, Netlist, NetlistError, mutate
from cubestack.hdl.devboard.netlist.cpp import board_header, expression
from cubestack.hdl.flow.tools import have_placer, have_yosys
from tests.hdl.devboard import exchange
from tests.hdl.devboard.exchange import compare, frame_requests, hello, random_requests

needs_tools = pytest.mark.skipif(
    not (have_yosys() and have_placer("ice40") and have_placer("ecp5")),
    reason="needs the extra board",
)


@pytest.mark.parametrize("inputs", [1, 2, 3, 4])
def test_expression_of_a_table_has_its_values(inputs: int) -> None:
    names = tuple("abcd"[:inputs])
    for seed in range(40):
        table = Random(seed).getrandbits(1 << inputs)
        text = expression(table, names)
        for row, levels in enumerate(itertools.product((0, -1), repeat=inputs)):
            values = {"none": 0, "all": -1} | dict(zip(names, reversed(levels), strict=True))
            assert eval(text, values) == -(table >> row & 1)


def test_combinational_loop_is_an_error_with_the_net_s_name() -> None:
    netlist = Netlist(1, 2, 3, luts=[Lut(4, (4,), 0b01)], names={4: "again"})
    with pytest.raises(NetlistError, match="loop through again"):
        board_header(netlist)


def test_input_that_a_table_ignores_is_no_loop() -> None:
    netlist = Netlist(1, 2, 3, luts=[Lut(3, (3, 2), 0b1100)])
    assert "tx =" in board_header(netlist)


def test_net_without_a_driver_is_an_error() -> None:
    netlist = Netlist(1, 2, 3, luts=[Lut(3, (9,), 0b10)], names={9: "lost"})
    with pytest.raises(NetlistError, match="lost is used"):
        board_header(netlist)


@pytest.mark.parametrize("name", MUTANTS)
def test_mutant_changes_only_the_copy_and_only_the_design(name: str) -> None:
    netlist = Netlist(1, 2, 3, luts=[Lut(4, (5, 6), 0b0110), Lut(7, (5, 6), 0b1000)])
    netlist.flip_flops = [FlipFlop(n, data, 1) for n, data in ((5, 4), (6, 7), (8, 4))]
    netlist.names = {n: f"bridged.design.x[{n}]" for n in (4, 5, 6)} | {8: "bridged.bridge.y"}
    before = (list(netlist.luts), list(netlist.flip_flops), dict(netlist.constants))
    changed, words = mutate(netlist, name, 1)
    assert "bridged.design" in words
    assert (netlist.luts, netlist.flip_flops, netlist.constants) == before
    assert (changed.luts, changed.flip_flops, changed.constants) != before


@pytest.fixture(scope="session")
def build_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("boards")


def built(folder: Path, name: str) -> tuple[Path, BridgeTiming]:
    """A build of the small design for a board, with a quick serial line; built once."""
    board = BOARDS[name]
    timing = BridgeTiming(board.bridge_hz, board.bridge_hz // 2)
    place = folder / name
    if not (place / BITSTREAM).exists():
        top = exchange.small_top()
        lines = lines_of(cubestar_wiring(top))
        assert not build(top, lines, board, timing, exchange.NAME, place).problem
    return place, timing


@needs_tools
@pytest.mark.slow
@pytest.mark.parametrize("name", ["icebreaker", "ulx3s"])
def test_placed_netlist_answers_as_the_model(name: str, build_folder: Path) -> None:
    place, timing = built(build_folder, name)
    assert (place / BITSTREAM).stat().st_size > 50_000
    board, _ = netlist_board(place)
    model, random = exchange.model(timing), Random(5)
    start = encode_frame(Frame(255, *hello()))
    assert model.receive(start) == board.receive(start)
    assert compare(model, board, random_requests(random, 1000, model), random) == 1000


def differs(place: Path, timing: BridgeTiming, mutant: str, seed: int) -> bool:
    board, fault = netlist_board(place, mutant, seed)
    assert fault
    model, random = exchange.model(timing), Random(5)
    requests = itertools.chain(frame_requests(), random_requests(random, 300, model))
    try:
        compare(model, board, requests, random)
    except AssertionError:
        return True
    return False


@needs_tools
@pytest.mark.slow
@pytest.mark.parametrize("mutant", MUTANTS)
def test_requests_find_a_fault_in_the_netlist(mutant: str, build_folder: Path) -> None:
    # Some faults change nothing, such as a bit of a table that no state of the design selects.
    place, timing = built(build_folder, "icebreaker")
    assert any(differs(place, timing, mutant, seed) for seed in (1, 3, 5, 7))
