"""Options --record and --trace of commands that run an emulated device."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from cubestack.host.devices.emulated import AnyEmulated
from cubestack.host.devices.records import create_file, start_recorder, start_trace

if TYPE_CHECKING:
    from cubestack.emulator.recording.recorder import Recorder
    from cubestack.firmware_model.formats.setup import Setup


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
    args: argparse.Namespace, emulated: AnyEmulated, stack: ExitStack, setup: Setup | None = None
) -> Recorder | None:
    """Start what the options ask for; ``stack`` ends it. Before any port is opened.

    ``setup`` is for the recording's header. Returns what records, if anything. Raises ValueError
    for a file that can not be written.
    """
    if args.trace is not None:
        stack.callback(start_trace(emulated, create_file(args.trace, stack)).close)
    if args.record is None:
        return None
    recorder = start_recorder(emulated, create_file(args.record, stack), setup)
    stack.callback(recorder.close)
    return recorder
