"""Options that say how a target is opened."""

import argparse
from pathlib import Path

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_value
from cubestack.host.cli.device_options import add_board_arguments, given_options, show_notices
from cubestack.host.devices.registry import device_names
from cubestack.host.emulation.remote_controls import TOKEN
from cubestack.host.targets import FORMS, Target, open_target
from cubestack.host.terminal import busy, say


def add_target_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("target", metavar="TARGET", help=FORMS)
    parser.add_argument(
        "--device", choices=device_names(), help="needed if TARGET does not name it"
    )
    parser.add_argument("--bench", metavar="TARGET", help="serial line with the bench protocol")
    parser.add_argument(
        "--backup", action="store_true", help="the serial line speaks the register protocol"
    )
    add_value(parser, "baud", whole(None, "baud rate of the serial line", 1))
    parser.add_argument("--scene", type=Path, metavar="FILE", help="for an emulated device")
    add_value(parser, "seed", whole(0, "for an emulated device", 0))
    parser.add_argument(
        "--control", metavar="URL", help=f"control port of the emulation; its token is in ${TOKEN}"
    )
    add_board_arguments(parser)
    parser.add_argument("--record", type=Path, metavar="FILE", help="record the session to FILE")


def open_any_target(text: str, args: argparse.Namespace) -> Target:
    """Open the target ``text`` with these options; raises what ``open_target`` does."""
    options = given_options(args)
    with busy(f"opening {text}"):
        target = open_target(
            text,
            args.device,
            service_port=args.bench,
            backup=args.backup,
            baud=args.baud,
            scene=args.scene,
            seed=args.seed,
            record=args.record,
            control=args.control,
            options=options,
        )
    if target.device is not None:
        show_notices(target.device, options, say)
    return target
