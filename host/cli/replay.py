"""Play a recording's host to an emulated device and compare what the device says.

The device is powered up like the recorded one: with the same --scene, --seed
and --faults. Exit code 0 when every byte came at the same time, 1 when one
differs: the first one of each port is named with its field.

examples:
  cubestack emulate cubesense --record run.rec
  cubestack replay run.rec
  cubestack replay run.rec --trace run.vcd
"""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from pathlib import Path

from cubestack.firmware_model.interface.recording import load_recording
from cubestack.host.cli.arguments import whole
from cubestack.host.cli.boards import DEVICES, open_board
from cubestack.host.cli.fault_plan import add_faults_argument, inject_plan
from cubestack.host.cli.records import add_record_arguments, port_uarts, record
from cubestack.host.cli.session import add_engine_arguments
from cubestack.host.targets import interface_of

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("recording", type=Path, metavar="FILE", help="see docs/recording.md")
    parser.add_argument("--scene", type=Path, metavar="SCENE", help="as when it was recorded")
    parser.add_argument("--seed", type=whole(0), default=0, help="as when it was recorded")
    add_faults_argument(parser)
    add_engine_arguments(parser)
    add_record_arguments(parser)
    parser.add_argument("--json", action="store_true", help="one object with all differences")


def run(args: argparse.Namespace) -> int:
    """Replay and report."""
    from cubestack.emulator.recording import Replay

    recording = load_recording(args.recording)
    interface = interface_of(recording.device, str(args.recording))
    if recording.device not in DEVICES:
        raise ValueError(f"{args.recording}: {recording.device} can not be emulated")
    baud = recording.bauds.get("uart")
    opened = open_board(recording.device, args.scene, seed=args.seed, engine=args.engine, baud=baud)
    with ExitStack() as stack:
        stack.callback(opened.board.close)
        inject_plan(opened.board.faults, args.faults)
        record(args, opened, stack)
        board = opened.board
        replay = Replay(recording, board.kernel, port_uarts(opened), board.i2c_bus)
        differences = replay.run(interface)
    if args.json:
        print(json.dumps({"recording": str(args.recording), "differences": differences}))
    else:
        duration_s = recording.end_ps / 1e12
        print("\n".join(differences) or f"{duration_s:.3f} s replayed: no difference")
    return int(bool(differences))
