"""Replay the host's side of a recording to an emulated device and compare its answers.

The device is powered up like the recorded one, as the recording says: its scene,
seed and faults, and what was done to it meanwhile. --scene, --seed and --faults
replace the recorded ones; differences in the set-up are reported. Exit status 0 if
every byte came at the same time, else 1 with the first different byte of each port
and its field. With --trace-from or --trace-to it replays to the end of that span
and compares nothing.

examples:
  cubestack emulate {second} --record run.rec
  cubestack replay run.rec
  cubestack replay run.rec --trace run.vcd
  cubestack replay run.rec --trace run.vcd --trace-from 2.5 --trace-to 3
"""

import argparse
import json

from cubestack.emulator.recording.replay import SETTLE_PS, Replay
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.formats.untrusted import shown_lines
from cubestack.firmware_model.values import number
from cubestack.host.cli.arguments import add_flag, add_path, add_value
from cubestack.host.cli.device_options import (
    add_board_arguments,
    add_record_arguments,
    add_start_arguments,
    given_options,
    record,
)
from cubestack.host.emulation.controls import EmulatedControls
from cubestack.host.emulation.history import Recipe
from cubestack.host.emulation.records import create_record, start_trace
from cubestack.host.output import Outputs
from cubestack.host.recording.setups import setup_for
from cubestack.host.terminal import busy, say

LATEST_S = 1e8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_path(parser, "recording", "see docs/how-to/recording.md")
    add_path(parser, "--scene", "replaces the recorded one", "SCENE")
    add_start_arguments(parser, seed=None, seed_help="replaces the recorded one")
    add_record_arguments(parser)
    add_board_arguments(parser)
    for name, what in (("trace_from", "begins"), ("trace_to", "ends")):
        add_value(parser, name, number(None, f"where --trace {what}", 0, LATEST_S, "s"))
    add_flag(parser, "--json", "print one JSON object with all differences")


def run(args: argparse.Namespace) -> int:
    span = _span(args)
    recording = load_recording(args.recording)
    given = given_options(args)
    setup = setup_for(
        recording, seed=args.seed, scene=args.scene, faults=args.faults, tell=say, given=given
    )
    with Outputs() as stack:
        opened = Recipe.of(recording, setup, given).make(args.engine)
        stack.callback(opened.close)
        whole = argparse.Namespace(record=args.record, trace=None if span else args.trace)
        record(whole, opened, stack, setup)
        board, act = opened.board, EmulatedControls(opened).act
        replay = Replay(recording, board.kernel, board.uarts, board.i2c_bus, act)
        if span is not None:
            stream = create_record(args.trace, stack)
            board.kernel.advance_to(span[0])
            trace = start_trace(opened, stream)
            end_ps = span[1] or recording.end_ps + SETTLE_PS
            board.kernel.advance_to(end_ps)
            trace.close(end_ps)
            return 0
        with busy("replaying", quiet=args.json):
            differences = replay.run(opened.device.interface)
    if args.json:
        print(json.dumps({"recording": str(args.recording), "differences": differences}))
    else:
        duration_s = recording.end_ps / 1e12
        cut = "" if recording.whole else "; the recording was cut off there"
        same = f"{duration_s:.3f} s replayed: no difference{cut}"
        print(shown_lines("\n".join(differences)) or same)
    return int(bool(differences))


def _span(args: argparse.Namespace) -> tuple[int, int] | None:
    """Beginning and end of a trace in ps, 0 for the recording's; None where all is played."""
    if args.trace_from is None and args.trace_to is None:
        return None
    if args.trace is None:
        raise ValueError("--trace-from and --trace-to: of --trace, which is not there")
    begin, end = (round((one or 0.0) * 1e12) for one in (args.trace_from, args.trace_to))
    if args.trace_to is not None and end <= begin:
        raise ValueError("--trace-to: behind --trace-from")
    return begin, end
