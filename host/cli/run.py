"""Run an unmodified program against emulated devices, on I2C or serial lines.

On I2C it sees their bus as /dev/i2c-N. That needs no privileges and no kernel
module: seccomp user notification, or a preloaded library, intercepts the program's
calls on that file. With --serial, {port} becomes the path of a pseudo-terminal. The
exit status is the program's.

examples:
  cubestack run -- i2cdetect -y 7
  cubestack run -- i2cget -y 7 0x1a 0x83
  cubestack run --bus 1 --pace fast -- python3 flight_software.py
  cubestack run --device {first} --device {second} --hz 400000 -- ./program
  cubestack run --attach -- i2cget -y 7 0x1a 0x83  on the bus of `emulate --i2c 7`
  cubestack run --serial {first} -- python3 flight_software.py {port}
"""

import argparse
import errno
import shutil
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.guest_process import RouteError
from cubestack.emulator.i2cdev.running import (
    HostBus,
    attached_bus,
    emulated_bus,
    run_beside,
    run_program,
)
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.formats.i2c_socket import socket_path
from cubestack.firmware_model.values import whole
from cubestack.host.cli import device_options
from cubestack.host.cli.arguments import add_flag, add_path, add_value
from cubestack.host.cli.ports import check_linux
from cubestack.host.devices.i2c_targets import i2c_targets
from cubestack.host.devices.registry import device, device_names, devices, emulated_names
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.emulation.terminals import PORT, Terminals
from cubestack.host.options import option_string
from cubestack.host.terminal import busy, say

DEFAULT_BUS = 7
STANDARD_HZ = 100_000
BOOT_LIMIT_PS = 10**12
"""Virtual time within which the devices have started; the program starts after them."""

NACK_ERRORS = ("ENXIO", "EREMOTEIO", "EIO", "ETIMEDOUT")
"""What Linux's drivers report, each its own, when nobody acknowledges an address."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_value(parser, "bus", whole(DEFAULT_BUS, "/dev/i2c-N (default 7)", 0, 255, metavar="N"))
    parser.add_argument(
        "--attach",
        nargs="?",
        const="",
        metavar="SOCKET",
        help="use the bus of a running emulation (default: the one that serves bus N)",
    )
    parser.add_argument(
        "--device",
        action="append",
        choices=device_names(),
        help=f"device on the bus; repeatable (default {device_names()[0]})",
    )
    parser.add_argument(
        "--serial",
        dest="on_serial",
        action="append",
        choices=emulated_names(),
        help="device on serial lines instead of I2C; repeatable. {port} is the first one's "
        "pseudo-terminal, {NAME} that of device NAME; its bench line has the suffix .bench",
    )
    add_flag(parser, "--strict-line", "with --serial: as for emulate")
    parser.add_argument(
        "--i2c-addr",
        action="append",
        type=_move,
        default=[],
        metavar="NAME=0xNN",
        help=f"change an address; NAME is {', '.join(_addresses())} or the old address",
    )
    add_path(parser, "--scene", "TOML scene of the one device (default: its own)")
    device_options.add_start_arguments(parser)
    device_options.add_board_arguments(parser, emulated_names())
    add_value(parser, "hz", whole(STANDARD_HZ, "bus clock in bits per second (default 100000)", 1))
    parser.add_argument(
        "--pace",
        choices=("real", "fast"),
        default="real",
        help="real: transfers take as long as on the wire; fast: as fast as possible",
    )
    parser.add_argument(
        "--nack-errno",
        choices=NACK_ERRORS,
        default="ENXIO",
        help="error when no device acknowledges an address (default ENXIO)",
    )
    parser.add_argument(
        "--route",
        choices=("seccomp", "preload"),
        help="how calls are intercepted (default: seccomp if the kernel allows it)",
    )
    add_flag(parser, "--quiet", "don't print bus and route")
    parser.add_argument("program", nargs="+", metavar="PROGRAM", help="after --, with arguments")


def run(args: argparse.Namespace) -> int:
    check_linux()
    if shutil.which(args.program[0]) is None:
        raise ValueError(f"{args.program[0]}: no such program; give a path, or a name on the PATH")
    with ExitStack() as stack:
        if args.on_serial:
            return _run_on_serial_lines(args, stack)
        if args.strict_line:
            raise ValueError("--strict-line goes with --serial")
        if args.attach is None:
            bus = _emulated(args, stack)
        else:
            bus = attached_bus(Path(args.attach) if args.attach else socket_path(args.bus))
            stack.callback(bus.port.close)
        if not args.quiet:
            found = ", ".join(f"{name} at {address:#04x}" for name, address in bus.targets)
            say(f"I2C bus {args.bus}: {found}")
        try:
            return run_program(
                args.program,
                args.bus,
                bus,
                pace=args.pace,
                route=args.route,
                report=(lambda _text: None) if args.quiet else say,
            )
        except RouteError as error:
            raise OSError(str(error)) from None


def _run_on_serial_lines(args: argparse.Namespace, stack: ExitStack) -> int:
    for name in ("attach", "device", "i2c_addr", "route"):
        if getattr(args, name) not in (None, []):
            raise ValueError(f"{option_string(name)} is for I2C: leave it out with --serial")
    report = (lambda _text: None) if args.quiet else say
    opened = _power_up(args.on_serial, args, stack)
    kernel = opened[0].board.kernel
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="cubestack-"))
    terminals = Terminals(opened, Path(folder), stack, strict=args.strict_line, report=say)
    words = terminals.fill_in(args.program)
    if words == args.program:
        places = ", ".join([PORT, *(f"{{{name}}}" for name in terminals.paths)])
        raise ValueError(f"no word of the program is a port; write {places} where its path goes")
    for one in opened:
        report(f"{one.device.title} serves on {terminals.paths[one.device.name]}")
    ends = [end for ends in terminals.endpoints for end in ends]
    return run_beside(
        words,
        kernel,
        lambda: any(one.board.busy() for one in opened),
        ends,
        pace=args.pace,
        report=report,
    )


def _power_up(
    names: Sequence[str], args: argparse.Namespace, stack: ExitStack
) -> list[AnyEmulated]:
    """The devices, booted; they share kernel and I2C bus."""
    if len(set(names)) < len(names):
        raise ValueError(f"name each device once: {' '.join(names)}")
    if len(names) > 1 and (args.scene or args.faults):
        raise ValueError("--scene and --faults are of one device, and several are emulated")
    opened: list[AnyEmulated] = []
    for name in names:
        beside = opened[0] if opened else None
        options = device_options.chosen_options(args, device(name))
        with busy(f"starting {device(name).title}", quiet=args.quiet):
            opened.append(
                open_device(
                    name, args.scene, seed=args.seed, engine=args.engine, beside=beside, **options
                )
            )
        stack.callback(opened[-1].close)
    device_options.inject_plan(opened[0].faults, args.faults, None if args.quiet else say)
    kernel = opened[0].board.kernel
    while any(one.board.busy() for one in opened) and kernel.now < BOOT_LIMIT_PS:
        kernel.step()
    return opened


def _emulated(args: argparse.Namespace, stack: ExitStack) -> HostBus:
    opened = _power_up(args.device or device_names()[:1], args, stack)
    board = opened[0].board
    kernel, bus = board.kernel, board.i2c_bus
    bus.bit_ps = PS_PER_S // args.hz
    for old, new in args.i2c_addr:
        bus.move(old, new)

    def at_work() -> bool:
        return any(one.board.busy() for one in opened)

    adapter = I2cAdapter(kernel, bus, address_errno=int(getattr(errno, args.nack_errno)))
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="cubestack-"))
    targets = i2c_targets((one.device for one in opened), args.i2c_addr)
    host_bus = emulated_bus(kernel, at_work, adapter, Path(folder) / f"i2c-{args.bus}", targets)
    stack.callback(host_bus.port.close)
    return host_bus


def _addresses() -> dict[str, int]:
    """What is where at first, of all devices."""
    return dict(i2c_targets(devices()))


def _move(text: str) -> tuple[int, int]:
    """Type of a pair of I2C addresses; the first one may be a name."""
    addresses = _addresses()
    name, _, new = text.partition("=")
    try:
        return addresses[name] if name in addresses else int(name, 0), int(new, 0)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not NAME=0xNN, as in {next(iter(addresses))}=0x2a; "
            f"names: {', '.join(addresses)}"
        ) from None
