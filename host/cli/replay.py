"""Play a recording's host to an emulated device and compare what the device says.

The device is powered up like the recorded one, as the recording says: its scene,
seed and faults, and what was done to it meanwhile. --scene, --seed and --faults
take their place, and what is not as it was is told. Exit code 0 when every byte
came at the same time, 1 when one differs: the first one of each port is named
with its field.

examples:
  cubestack emulate {second} --record run.rec
  cubestack replay run.rec
  cubestack replay run.rec --trace run.vcd
"""

import argparse
import json
from contextlib import ExitStack
from pathlib import Path

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.cli.device_options import add_record_arguments, add_start_arguments, record
from cubestack.host.devices.controls import EmulatedControls
from cubestack.host.devices.past import Recipe
from cubestack.host.recording.setups import setup_for
from cubestack.host.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("recording", type=Path, metavar="FILE", help="see docs/recording.md")
    parser.add_argument("--scene", type=Path, metavar="SCENE", help="another one than recorded")
    add_start_arguments(parser, seed=None, seed_help="another one than recorded")
    add_record_arguments(parser)
    parser.add_argument("--json", action="store_true", help="one object with all differences")


def run(args: argparse.Namespace) -> int:
    """Replay and report."""
    from cubestack.emulator.recording.replay import Replay

    recording = load_recording(args.recording)
    setup = setup_for(recording, seed=args.seed, scene=args.scene, faults=args.faults, tell=say)
    with ExitStack() as stack:
        opened = Recipe.of(recording, setup).make(args.engine)
        stack.callback(opened.close)
        recorder = record(args, opened, stack, setup)
        board = opened.board
        controls = EmulatedControls(opened)
        if recorder is not None:
            controls.on_act = lambda words, text: recorder.control(board.kernel.now, words, text)
        replay = Replay(recording, board.kernel, board.uarts, board.i2c_bus, controls.act)
        differences = replay.run(opened.device.interface)
    if args.json:
        print(json.dumps({"recording": str(args.recording), "differences": differences}))
    else:
        duration_s = recording.end_ps / 1e12
        print("\n".join(differences) or f"{duration_s:.3f} s replayed: no difference")
    return int(bool(differences))
