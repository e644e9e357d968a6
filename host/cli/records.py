"""Options --record and --trace of commands that run an emulated device."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from cubestack.emulator.recording.recorder import Recorder
    from cubestack.firmware_model.formats.setup import Setup
    from cubestack.host.devices.boards import Opened

__all__ = ["add_record_arguments", "create_file", "record"]


def add_record_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--record", type=Path, metavar="FILE", help="every byte of all ports (docs/recording.md)"
    )
    parser.add_argument(
        "--trace",
        type=Path,
        metavar="FILE.vcd",
        help="lines, buses, FPGA pins and firmware for a waveform viewer",
    )


def record(
    args: argparse.Namespace, opened: Opened, stack: ExitStack, setup: Setup | None = None
) -> Recorder | None:
    """Start what the options ask for; ``stack`` ends it. Before any port is opened.

    The board's I2C bus is replaced by one that is listened to. ``setup`` is for the recording's
    header. Returns what records, if anything. Raises ValueError for a file that can not be written.
    """
    from cubestack.emulator.recording.recorder import Recorder
    from cubestack.emulator.recording.trace import VcdTrace

    board = opened.board
    device, uarts = opened.title.lower(), board.uarts
    if args.trace is not None:
        stream = create_file(args.trace, stack)
        trace = VcdTrace(stream, device, board.kernel, uarts, board.engine, board.probes)
        stack.callback(trace.close)
        board.i2c_bus = trace.bus(board.i2c_bus)
    if args.record is None:
        return None
    recorder = Recorder(create_file(args.record, stack), device, uarts, setup)
    stack.callback(recorder.close)
    board.i2c_bus = recorder.bus(board.i2c_bus)
    return recorder


def create_file(path: Path, stack: ExitStack) -> IO[str]:
    """``path`` for writing, closed by ``stack``; ValueError when it can not be written."""
    try:
        return stack.enter_context(path.open("w", encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"can not write {path}: {error.strerror}") from None
