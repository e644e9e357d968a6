"""Recordings and traces at the pins of an emulated device."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING

from cubestack.host.emulation.emulated import AnyEmulated

if TYPE_CHECKING:
    from cubestack.emulator.recording.recorder import Recorder
    from cubestack.emulator.recording.trace import VcdTrace
    from cubestack.firmware_model.formats.setup import Setup


def start_recorder(
    emulated: AnyEmulated, stream: IO[str], setup: "Setup | None" = None
) -> "Recorder":
    """Record every byte of all ports; call it before any port opens.

    ``setup`` goes into the header, with the profile.
    """
    from cubestack.emulator.recording.recorder import Recorder

    board = emulated.board
    if setup is not None:
        setup = replace(setup, options={**setup.options, **emulated.chosen})
    recorder = Recorder(stream, emulated.device.name, board.uarts, setup)
    recorder.listen(board.i2c_bus)
    return recorder


def start_trace(emulated: AnyEmulated, stream: IO[str]) -> "VcdTrace":
    """Trace lines, buses, FPGA pins and firmware variables into a VCD file."""
    from cubestack.emulator.recording.trace import VcdTrace

    board = emulated.board
    trace = VcdTrace(
        stream,
        emulated.device.name,
        board.kernel,
        board.uarts,
        board.engine,
        board.probes,
        None if board.insight is None else board.insight.history,
    )
    trace.listen(board.i2c_bus)
    return trace


def create_file(path: Path, stack: ExitStack) -> IO[str]:
    """Open ``path`` for writing; ``stack`` closes it. Raises ValueError if it cannot be written."""
    try:
        return stack.enter_context(path.open("w", encoding="utf-8", newline=""))
    except OSError as error:
        raise ValueError(f"can not write {path}: {error.strerror}") from None
