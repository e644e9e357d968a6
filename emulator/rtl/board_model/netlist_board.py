"""The board of a finished build, from its placed netlist."""

from pathlib import Path

from cubestack.emulator.rtl.board_model.board import SimulatedBoard
from cubestack.hdl.devboard.bitstream import PLACED, Built
from cubestack.hdl.devboard.netlist import board_header, mutate, read_netlist


def netlist_board(folder: Path, mutant: str = "", seed: int = 0) -> tuple[SimulatedBoard, str]:
    """The simulated board of the build in ``folder``, and what is wrong with it.

    Args:
        folder: of ``hdl.devboard.bitstream.build``.
        mutant: name of a fault to plant, see ``hdl.devboard.netlist.mutants``; none if empty.
        seed: chooses its place.

    Raises:
        OSError: there is no build in the folder.
        NetlistError: a cell has no model.
        CompilerError: there is no C++ compiler, or it failed.
    """
    built = Built.load(folder)
    netlist, fault = read_netlist(folder / PLACED, built.family), ""
    if mutant:
        netlist, fault = mutate(netlist, mutant, seed)
    return SimulatedBoard(board_header(netlist), built.divider), fault
