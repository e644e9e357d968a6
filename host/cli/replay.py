"""Play a recording's host to an emulated device and compare what the device says.

The device is powered up like the recorded one, as the recording says: its scene,
seed and faults, and what was done to it meanwhile. --scene, --seed and --faults
take their place, and what is not as it was is told. Exit code 0 when every byte
came at the same time, 1 when one differs: the first one of each port is named
with its field.

examples:
  cubestack emulate cubesense --record run.rec
  cubestack replay run.rec
  cubestack replay run.rec --trace run.vcd
"""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack, nullcontext
from pathlib import Path

from cubestack.firmware_model.formats.recording import Recording, load_recording
from cubestack.firmware_model.formats.setup import Setup
from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.host.cli.arguments import whole
from cubestack.host.cli.fault_plan import add_faults_argument
from cubestack.host.cli.records import add_record_arguments, record
from cubestack.host.cli.session import Engine, add_engine_arguments
from cubestack.host.cli.terminal import say
from cubestack.host.devices.boards import DEVICES, Opened, open_board
from cubestack.host.devices.controls import BoardControls
from cubestack.host.devices.targets import interface_of
from cubestack.host.recording.setups import setup_for, written

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("recording", type=Path, metavar="FILE", help="see docs/recording.md")
    parser.add_argument("--scene", type=Path, metavar="SCENE", help="another one than recorded")
    parser.add_argument("--seed", type=whole(0), help="another one than recorded")
    add_faults_argument(parser)
    add_engine_arguments(parser)
    add_record_arguments(parser)
    parser.add_argument("--json", action="store_true", help="one object with all differences")


def run(args: argparse.Namespace) -> int:
    """Replay and report."""
    from cubestack.emulator.recording.replay import Replay

    recording = load_recording(args.recording)
    interface = interface_of(recording.device, str(args.recording))
    if recording.device not in DEVICES:
        raise ValueError(f"{args.recording}: {recording.device} can not be emulated")
    setup = setup_for(recording, seed=args.seed, scene=args.scene, faults=args.faults, tell=say)
    with ExitStack() as stack:
        opened = _open(recording, setup, args.engine)
        stack.callback(opened.board.close)
        if setup.faults is not None:
            from cubestack.emulator.faults.plan import parse_plan

            opened.board.faults.load(parse_plan(setup.faults.text, setup.faults.name))
        recorder = record(args, opened, stack, setup)
        board = opened.board
        controls = BoardControls(board, recording.device)
        if recorder is not None:
            controls.on_act = lambda words, text: recorder.control(board.kernel.now, words, text)
        replay = Replay(recording, board.kernel, board.uarts, board.i2c_bus, controls.act)
        differences = replay.run(interface)
    if args.json:
        print(json.dumps({"recording": str(args.recording), "differences": differences}))
    else:
        duration_s = recording.end_ps / 1e12
        print("\n".join(differences) or f"{duration_s:.3f} s replayed: no difference")
    return int(bool(differences))


def _open(recording: Recording, setup: Setup, engine: Engine) -> Opened:
    """The device, made as ``setup`` says."""
    options = dict(setup.options)
    mcu_addressing = options.pop("mcu_addressing", False)
    layout = Layout(options.pop("layout", Layout.COPIED.value))
    if options:
        raise ValueError(f"{recording.name}: its setup has an unknown option {min(options)!r}")
    with nullcontext() if setup.scene is None else written(setup.scene) as scene:
        return open_board(
            recording.device,
            scene,
            seed=setup.seed,
            engine=engine,
            baud=recording.bauds.get("uart"),
            mcu_addressing=bool(mcu_addressing),
            layout=layout,
        )
