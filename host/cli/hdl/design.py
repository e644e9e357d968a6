"""Designs of a device's FPGA: options of the actions that check one, and its wiring."""

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from cubestack.hdl.contract.contract import Contract
from cubestack.hdl.contract.design import Design
from cubestack.host.devices.device import AnyDevice
from cubestack.host.devices.registry import device, devices
from cubestack.host.emulation.emulated import power_up

if TYPE_CHECKING:
    from cubestack.emulator.rtl.wiring import Wiring

FILE = "design.v[:TOP], files with commas, a folder, a list of files, or MODULE:CLASS"


def add_design(parser: argparse.ArgumentParser) -> None:
    """The device and the design's parameters; FILE is each action's own."""
    parser.add_argument("--device", metavar="DEVICE", help="whose FPGA the design is for")
    parser.add_argument(
        "--gateware-param",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="a parameter of the design; may be repeated",
    )


def design_of(args: argparse.Namespace, text: str, image: str = "") -> Design:
    """The design that is checked; ValueError for a device without a contract."""
    parameters = dict(map(_parameter, args.gateware_param))
    return Design(_contract(args.device), text, parameters, image=image)


def fpga_wiring(chosen: AnyDevice, options: Mapping[str, Any]) -> "Wiring":
    """The FPGA of a device with these options of its board, and its surroundings."""
    emulated = power_up(chosen, **options)
    try:
        assert emulated.board.engine is not None
        return emulated.board.engine.wiring
    finally:
        emulated.close()


def _contract(name: str | None) -> Contract:
    with_one = [one for one in devices() if one.contract is not None]
    names = ", ".join(one.name for one in with_one)
    if name is None:
        raise ValueError(f"say whose FPGA the design is for: --device with one of {names}")
    found = device(name).contract
    if found is None:
        raise ValueError(f"{name} declares no contract for its FPGA; devices with one: {names}")
    return found()


def _parameter(text: str) -> tuple[str, int | str]:
    name, equals, value = text.partition("=")
    if not equals or not name.isidentifier():
        raise ValueError(f"--gateware-param takes NAME=VALUE, not {text!r}")
    try:
        return name, int(value, 0)
    except ValueError:
        return name, value
