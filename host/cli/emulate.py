"""Serve emulated devices until Ctrl-C; any program can open their ports.

A device with a second serial line serves it on PATH.bench or PORT + 1. Several
devices take ports one after the other, and share one virtual time and I2C bus.

examples:
  cubestack emulate {first} --pty ./tty
      then, in a second terminal:
      .venv/bin/python examples/plain_pyserial.py ./tty
  cubestack emulate {first} --scene sky.toml --tcp 4000 --pace fast
  cubestack emulate {second} --pty ./tty --record session.jsonl
  cubestack emulate {first} {second} {third} --i2c 7
      then: cubestack run --attach -- i2cdetect -y 7
  cubestack emulate efm32gg --firmware app.elf --serial uart0@PE0,PE1:./tty
  cubestack emulate {first} --control 8700     pause, step, faults by HTTP
"""

import argparse
import os
import signal
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from cubestack.emulator.boards.contract import SerialLine
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.scheduler import open_scheduler
from cubestack.emulator.i2cdev.server import I2cServer
from cubestack.emulator.ports.control import ControlPort
from cubestack.emulator.ports.endpoint import Lifeline
from cubestack.emulator.ports.serial_port import SerialPort
from cubestack.emulator.scene.orbit_file import load_orbit
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.formats.i2c_socket import socket_path
from cubestack.firmware_model.formats.setup import Setup
from cubestack.firmware_model.values import duration, whole
from cubestack.host.cli import device_options
from cubestack.host.cli.arguments import add_path, add_value
from cubestack.host.cli.ports import LAST_PORT, add_port_arguments, check_linux, open_ports
from cubestack.host.cli.program import exit_status, read_console
from cubestack.host.devices.i2c_targets import i2c_targets
from cubestack.host.devices.registry import device, devices, emulated_names
from cubestack.host.emulation.emulated import AnyEmulated, power_up
from cubestack.host.emulation.history import History
from cubestack.host.emulation.orbit import follow
from cubestack.host.emulation.remote_controls import TOKEN
from cubestack.host.options import option_string
from cubestack.host.output import Outputs
from cubestack.host.recording.setups import emulated_setup
from cubestack.host.terminal import busy, progress, say

ONE_DEVICE = (
    *("scene", "faults", "record", "trace", "set"),
    *("gdb", "gdb_wait", "profile_out", "coverage_out"),
)
"""Options that belong to one device."""

TIMED_OUT = 1
"""Exit status after the time-out."""

FORWARD_ONLY = ("trace", "gdb", "profile_out", "coverage_out", "orbit", "timeout")
"""Options whose effects can't be undone, so going back in time is off."""

Served = Sequence[tuple[AnyEmulated, SerialLine, SerialPort]]
"""Owner, line and port of each serial line."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    scenes = dict.fromkeys(device.default_scene_title for device in devices())
    parser.add_argument(
        "devices",
        nargs="+",
        choices=emulated_names(),
        metavar="device",
        help=", ".join(emulated_names()),
    )
    add_path(parser, "--scene", f"TOML scene of the one device; default: {', or '.join(scenes)}")
    add_path(
        parser,
        "--orbit",
        "TOML orbit of the satellite that all devices are on (docs/how-to/orbit.md)",
    )
    add_port_arguments(parser)
    add_value(
        parser, "i2c", whole(None, "I2C bus, for cubestack run --attach", 0, 255, metavar="BUS")
    )
    add_value(parser, "baud", whole(None, "of the node protocol; default 57600", 1))
    device_options.add_start_arguments(parser)
    device_options.add_board_arguments(parser, emulated_names(), serving=True)
    parser.add_argument(
        "--pace",
        choices=("real", "fast"),
        default="real",
        help="real: virtual time follows wall time; fast: as fast as possible",
    )
    timeout = duration(None, "end after this virtual time, such as 5s, with exit status 1")
    add_value(parser, "timeout", timeout)
    add_value(
        parser,
        "control",
        whole(
            None,
            f"HTTP port for control (docs/how-to/control.md); token in ${TOKEN}, or a new one",
            0,
            LAST_PORT,
            metavar="PORT",
        ),
    )
    add_value(parser, "lifeline", whole(None, argparse.SUPPRESS, 0))
    device_options.add_record_arguments(parser)
    device_options.add_insight_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until SIGINT, SIGTERM or the time-out, or without gdb until a program exits.

    Returns the program's status, or ``TIMED_OUT`` after the time-out.
    """
    ended: list[int] = []
    _check(args)
    with Outputs() as stack:
        opened, setups = _power_up(args, stack)
        first = opened[0]
        gdb = None
        if len(opened) == 1:
            device_options.inject_plan(first.faults, args.faults)
            gdb = device_options.insight(args, stack)(first)
        if args.orbit is not None:
            _follow_orbit(args.orbit, opened)
        history = _history(args, opened, setups, stack)
        board = first.board  # a recording may have replaced its I2C bus
        adapter = I2cAdapter(board.kernel, board.i2c_bus)
        served = open_ports(args, opened, stack)
        lifeline = None if args.lifeline is None else Lifeline(args.lifeline)
        control = _control(args, opened, served, history, stack)
        i2c_ports = []
        if args.i2c is not None:
            targets = i2c_targets(one.device for one in opened)
            i2c_ports.append(I2cServer(socket_path(args.i2c), adapter, targets))
            stack.callback(i2c_ports[0].close)
        scheduler = stack.enter_context(
            open_scheduler(
                board.kernel,
                [
                    *(endpoint for _, _, endpoint in served),
                    *(one for one in (gdb, control, lifeline) if one),
                ],
                lambda: args.timeout is not None or any(one.board.busy() for one in opened),
                pace=args.pace,
                i2c=adapter if i2c_ports else None,
                i2c_ports=i2c_ports,
                report=say,
            )
        )
        if control is not None:
            control.scheduler = scheduler
        if lifeline is not None:
            stack.callback(lifeline.close)
            lifeline.on_end = scheduler.stop

        def exited(status: int) -> None:
            say(f"the program exited by semihosting with status {status}")
            ended.append(exit_status(status))
            if args.gdb is None:  # else a debugger can look at the program, or restart it
                scheduler.stop()

        def timed_out(_event: object) -> None:
            if ended and args.gdb is None:
                return  # just before
            say(f"time-out: {args.timeout:g} s of virtual time have passed")
            board.kernel.hold("time-out")
            ended.append(TIMED_OUT)
            scheduler.stop()

        if args.timeout is not None:
            end = board.kernel.timeout(round(args.timeout * PS_PER_S))
            end.callbacks.append(timed_out)

        def connect(emulated: AnyEmulated) -> None:
            _report_events(emulated)
            emulated.board.connect_program(exited, read_console)

        for one in opened:
            connect(one)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: scheduler.stop())
        _announce(args, opened, served)
        stack.keep()
        if isinstance(history, History):
            history.keep()
            history.on_arrival = connect
            history.bus = adapter
            history.ports = [(opened.index(owner), line.name, end) for owner, line, end in served]
        scheduler.run()
    return ended[-1] if ended else 0


def _check(args: argparse.Namespace) -> None:
    """Raise ValueError for options that exclude each other."""
    if len(set(args.devices)) < len(args.devices):
        raise ValueError(f"name each device once: {' '.join(args.devices)}")
    if len(args.devices) > 1:
        for name in ONE_DEVICE:
            value = getattr(args, name)
            if value not in (None, "") and value is not False:
                raise ValueError(
                    f"{option_string(name)} applies to one device, but several are given"
                )
    if args.i2c is not None:
        check_linux()


def _power_up(args: argparse.Namespace, stack: ExitStack) -> tuple[list[AnyEmulated], list[Setup]]:
    """The devices in their order, sharing kernel and I2C bus; ``stack`` closes them."""
    opened: list[AnyEmulated] = []
    setups: list[Setup] = []
    stack.callback(_close_all, opened)  # also those that replace others in the list
    for name in args.devices:
        found = device(name)
        options = device_options.chosen_options(args, found)
        with busy(f"starting {found.title}"):
            found.prepare(progress)
            emulated = power_up(
                found,
                args.scene,
                seed=args.seed,
                engine=args.engine,
                baud=args.baud,
                beside=opened[0] if opened else None,
                **options,
            )
        opened.append(emulated)
        setups.append(emulated_setup(args.seed, args.scene, args.faults, options))
        device_options.show_notices(found, options, say)
    return opened, setups


def _close_all(opened: list[AnyEmulated]) -> None:
    for one in opened:
        one.close()


def _follow_orbit(path: Path, opened: list[AnyEmulated]) -> None:
    """Drive the scenes from an orbit file; ValueError names the file."""
    orbit = load_orbit(path)
    try:
        follow(orbit, opened)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _announce(args: argparse.Namespace, opened: list[AnyEmulated], served: Served) -> None:
    for one in opened:
        ports = [
            f"{'' if line.has_node else line.title + ' on '}{end.name} at {line.baud} baud"
            for owner, line, end in served
            if owner is one
        ]
        say(f"{one.device.title} serves on {', '.join(ports)}; Ctrl-C ends it")
    if args.i2c is not None:
        say(f"I2C bus {args.i2c}: cubestack run --attach --bus {args.i2c} -- PROGRAM")


def _report_events(emulated: AnyEmulated) -> None:
    emulated.board.connect_console(say)
    emulated.faults.on_event = lambda event: say(str(event))


LARGEST_HISTORY = 1 << 30
"""Bytes of a device's history among the temporary files, without --record."""


def _history(
    args: argparse.Namespace, opened: list[AnyEmulated], setups: Sequence[Setup], stack: Outputs
) -> History | str:
    """The history that the control port can go back in, or why there is none."""
    given = [option_string(name) for name in FORWARD_ONLY if getattr(args, name) is not None]
    if args.control is None or given:
        if len(opened) == 1:
            device_options.record(args, opened[0], stack, setups[0])
        return f"{given[0]} can't be undone" if given else "nothing is recorded"
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="cubestack-")))
    files = [args.record or folder / f"{one.device.name}.rec" for one in opened]
    largest = LARGEST_HISTORY if args.record is None else None
    history = History(opened, setups, files, args.engine, largest)
    stack.callback(history.close)
    return history


def _control(
    args: argparse.Namespace,
    opened: Sequence[AnyEmulated],
    served: Served,
    history: History | str,
    stack: ExitStack,
) -> ControlPort | None:
    """The control port, served by a thread, or None."""
    if args.control is None:
        return None
    from cubestack.host.ground.control_api import control_app
    from cubestack.host.ground.emulation import Emulation
    from cubestack.host.ground.guard import Guard, new_token
    from cubestack.host.ground.serving import Serving

    port = ControlPort(opened[0].board.kernel)
    ports: dict[str, list[str]] = {}
    for owner, _, endpoint in served:
        ports.setdefault(owner.device.name, []).append(endpoint.name)
    token = os.environ.get(TOKEN) or new_token()
    emulation = Emulation(port, opened, ports, history)
    guard = Guard(control_app(emulation), token, any_host=args.allow_remote)
    serving = Serving(guard, args.listen, args.control, allow_remote=args.allow_remote)
    stack.enter_context(serving.running())
    stack.callback(emulation.bench.close)
    stack.callback(port.close)  # first: it answers the requests that still wait
    say(f"control on {serving.url}, token {token}")
    return port
