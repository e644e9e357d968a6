"""The board of a finished build, from its placed netlist."""

from pathlib import Path

from cubestack.emulator.rtl.board_model.board import SimulatedBoard, SimulatedBoards
from cubestack.hdl.devboard.bitstream import PLACED, Built
from cubestack.hdl.devboard.netlist import board_header, mutate, read_netlist


def netlist_board(folder: Path, mutant: str = "", seed: int = 0) -> tuple[SimulatedBoard, str]:
    """The simulated board of the build in ``folder``, and its fault: see `netlist_boards`."""
    header, divider, fault = _netlist(folder, mutant, seed)
    return SimulatedBoard(header, divider), fault


def netlist_boards(
    folder: Path, count: int, mutant: str = "", seed: int = 0
) -> tuple[SimulatedBoards, str]:
    """Simulated boards of the build in ``folder``, and what is wrong with all of them.

    Args:
        folder: of ``hdl.devboard.bitstream.build``.
        mutant: name of a fault to plant, see ``hdl.devboard.netlist.mutants``; none if empty.
        seed: chooses its place.

    Raises:
        OSError: there is no build in the folder.
        NetlistError: a cell has no model.
        CompilerError: there is no C++ compiler, or it failed.
        ValueError: more boards than can run side by side.
    """
    header, divider, fault = _netlist(folder, mutant, seed)
    return SimulatedBoards(header, divider, count=count), fault


def _netlist(folder: Path, mutant: str, seed: int) -> tuple[str, int, str]:
    built = Built.load(folder)
    netlist, fault = read_netlist(folder / PLACED, built.family), ""
    if mutant:
        netlist, fault = mutate(netlist, mutant, seed)
    return board_header(netlist), built.divider, fault
