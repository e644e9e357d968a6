"""Options that say how a device is made: its engine, and what its board alone has."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import Any, get_args

from cubestack.host.devices.device import AnyDevice, BoardOption, Engine
from cubestack.host.devices.registry import devices


def add_engine_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the option that says how the FPGA is run."""
    parser.add_argument(
        "--engine",
        choices=get_args(Engine),
        default="auto",
        help="how the FPGA is run (default: compiled where there is a compiler)",
    )


def add_board_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options that one device's board alone has, of all registered devices."""
    for device in devices():
        for option in device.options:
            add_option(parser, option, f"{device.name}: ")


def add_option(parser: argparse.ArgumentParser, option: BoardOption, prefix: str = "") -> None:
    """Declare one of them; ``prefix`` goes before its help."""
    text = prefix + option.help
    if option.choices:
        parser.add_argument(
            option.flag,
            dest=option.name,
            choices=option.choices,
            metavar="|".join(option.choices),
            help=text,
        )
    else:
        parser.add_argument(
            option.flag, dest=option.name, action="store_const", const=True, help=text
        )


def chosen_options(args: argparse.Namespace, device: AnyDevice) -> dict[str, Any]:
    """The board options that were given, but for defaults.

    Raises ValueError for one that is of another device.
    """
    own = {option.name for option in device.options}
    chosen = {}
    for other in devices():
        for option in other.options:
            value = getattr(args, option.name, None)
            if value is None or value == option.default:
                continue
            if option.name not in own:
                raise ValueError(
                    f"{option.flag} is an option of {other.name}, not of {device.name}"
                )
            chosen[option.name] = value
    return chosen


def tell_notices(
    device: AnyDevice, options: Mapping[str, Any], tell: Callable[[str], None]
) -> None:
    """Tell what a user must know of the chosen ``options``."""
    for option in device.options:
        notice = option.notice(options[option.name]) if option.name in options else None
        if notice is not None:
            tell(notice)
