"""A user's own firmware on an emulated device, run until it exits by semihosting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cubestack.host.emulation.virtual_serial import PS_PER_S

if TYPE_CHECKING:
    from cubestack.emulator.boards.contract import Board


@dataclass(frozen=True)
class ProgramExit:
    """How a program ended."""

    status: int  #: as it gave it; 0 is success
    output: str  #: what it printed on its debug channels, and reports of its faults
    time_s: float  #: virtual time since power-up


def run_to_exit(board: Board, timeout_s: float) -> ProgramExit:
    """Let virtual time pass until the program exits, at most ``timeout_s``.

    The console's input is empty. Raises ValueError for a board without own firmware, TimeoutError
    with the output for a program that does not exit in time.
    """
    if board.insight is None:
        raise ValueError("only own firmware exits; choose an image with firmware")
    lines: list[str] = []
    statuses: list[int] = []
    board.connect_console(lines.append)
    board.connect_program(statuses.append, lambda _count: b"")
    kernel = board.kernel
    end_ps = kernel.now + round(timeout_s * PS_PER_S)
    kernel.urgent(end_ps)
    while not statuses:
        if kernel.now >= end_ps:
            output = "\n".join(["; it printed:", *lines]) if lines else ""
            raise TimeoutError(f"no exit by semihosting within {timeout_s:g} s{output}")
        kernel.step()
    return ProgramExit(statuses[0], "".join(f"{line}\n" for line in lines), kernel.now / PS_PER_S)
