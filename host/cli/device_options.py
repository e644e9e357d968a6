"""Options of commands that run an emulated device or open a target."""

import argparse
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_flag, add_output, add_path, add_value
from cubestack.host.devices.device import (
    ENGINE_FORM,
    GATEWARE_OPTIONS,
    PROFILE_OPTIONS,
    AnyDevice,
    BoardOption,
    engine_name,
)
from cubestack.host.devices.registry import device_names, devices, emulated_names
from cubestack.host.emulation.emulated import AnyEmulated, check_options
from cubestack.host.emulation.records import (
    InsightFiles,
    create_record,
    open_gdb,
    start_recorder,
    start_trace,
)
from cubestack.host.emulation.remote_controls import TOKEN
from cubestack.host.options import option_string
from cubestack.host.output import Outputs
from cubestack.host.targets import FORMS, Target, open_target
from cubestack.host.terminal import busy, say

if TYPE_CHECKING:
    from cubestack.emulator.faults.injector import Faults
    from cubestack.emulator.ports.gdb import GdbEndpoint
    from cubestack.emulator.recording.recorder import Recorder
    from cubestack.firmware_model.formats.setup import Setup


def add_start_arguments(
    parser: argparse.ArgumentParser,
    seed: int | None = 0,
    seed_help: str = "seed of everything random (default 0)",
) -> None:
    """Declare the options for the seed, whose default is ``seed``, for faults and the engine."""
    add_value(parser, "seed", whole(seed, seed_help, 0))
    add_path(parser, "--faults", "TOML fault plan (docs/how-to/faults.md)")
    add_engine_arguments(parser)


def add_engine_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--engine",
        type=_engine,
        default="auto",
        metavar=ENGINE_FORM,
        help="how to run the FPGA (default: compiled, if a compiler is installed); a development"
        " board as docs/how-to/fpga-board.md describes",
    )


def _engine(text: str) -> str:
    try:
        return engine_name(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def add_board_arguments(
    parser: argparse.ArgumentParser, names: Iterable[str] | None = None, *, serving: bool = False
) -> None:
    """Declare the options of single devices' boards; of one that several have, the first's.

    ``names`` as for ``devices``; ``serving``: also those that lead lines to ports.
    """
    found: dict[str, tuple[BoardOption, list[str]]] = {}
    for device in devices(names):
        for option in device.options:
            common = option.name in {one.name for one in GATEWARE_OPTIONS}
            if not common and (serving or not option.serves):
                found.setdefault(option.name, (option, []))[1].append(device.name)
    group = parser.add_argument_group("device, its firmware and its FPGA")
    for option, owners in found.values():
        add_option(group, option, f"{', '.join(owners)}: ")
    for option in (*GATEWARE_OPTIONS, *PROFILE_OPTIONS):
        add_option(group, option)


def add_option(parser: argparse._ActionsContainer, option: BoardOption, prefix: str = "") -> None:
    """Declare one of them; ``prefix`` goes before its help."""
    how = {"action": _Joined} if option.repeats else {}
    add_value(parser, option.name, option, default=None, help=prefix + option.meaning, **how)


class _Joined(argparse.Action):
    """Joins the values of a repeated option by commas."""

    def __call__(self, _parser: Any, args: argparse.Namespace, value: Any, _name: Any = "") -> None:
        before = getattr(args, self.dest)
        setattr(args, self.dest, value if before is None else f"{before},{value}")


def options_of_others(device: AnyDevice) -> dict[str, list[str]]:
    """Flags of boards that ``device`` does not have, and the names of the devices that do."""
    own = {option.name for option in device.all_options}
    found: dict[str, list[str]] = {}
    for other in devices(emulated_names()):
        for option in other.all_options:
            if option.name not in own:
                found.setdefault(option.flag, []).append(other.name)
    return found


def given_options(args: argparse.Namespace) -> dict[str, Any]:
    """The board options that were given, whichever device has them."""
    known = devices(emulated_names())
    names = dict.fromkeys(option.name for device in known for option in device.all_options)
    return {name: value for name in names if (value := getattr(args, name, None)) is not None}


def chosen_options(args: argparse.Namespace, device: AnyDevice) -> dict[str, Any]:
    """The same for a device; ValueError for another one's."""
    options = given_options(args)
    check_options(device, options, option_string)
    return options


def show_notices(
    device: AnyDevice, options: Mapping[str, Any], tell: Callable[[str], None]
) -> None:
    for option in device.all_options:
        notice = option.notice(options[option.name]) if option.name in options else None
        if notice is not None:
            tell(notice)


def inject_plan(
    faults: "Faults", path: Path | None, told: Callable[[str], None] | None = None
) -> None:
    """Inject the plan in ``path``, if one is given; ``told`` receives a line per effect of a fault.

    Raises FaultError (a ValueError) for a plan that makes no sense.
    """
    from cubestack.emulator.faults.plan import load_plan

    if path is None:
        return
    faults.load(load_plan(path))
    if told is not None:
        tell = told
        faults.on_event = lambda event: tell(str(event))


def add_record_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("records")
    add_output(
        group, "--record", "record every byte of all ports to FILE (docs/how-to/recording.md)"
    )
    add_output(
        group,
        "--trace",
        "write serial lines, buses, FPGA pins and firmware variables as a waveform",
        "FILE.vcd",
    )


def add_insight_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("insight into own firmware")
    add_value(
        group,
        "gdb",
        whole(
            None,
            "serve gdb on this port of this machine, for --firmware (docs/how-to/own-firmware.md)",
            0,
            0xFFFF,
            metavar="PORT",
        ),
    )
    add_flag(group, "--gdb-wait", "with --gdb: wait for gdb before the first instruction")
    add_output(group, "--profile-out", "cycles by function and line of --firmware, for kcachegrind")
    add_output(group, "--coverage-out", "executed lines of --firmware, as an lcov file")


def insight(
    args: argparse.Namespace, stack: Outputs
) -> "Callable[[AnyEmulated], GdbEndpoint | None]":
    """What to do with each device that is powered up; ``stack`` writes the files in the end.

    Raises ValueError for a file that can not be written. The answer gives the port for gdb, if one
    is wanted; it raises ValueError for a device without firmware of its own, and PortError.
    """
    files = InsightFiles(args.profile_out, args.coverage_out).open(stack)
    if args.gdb_wait and args.gdb is None:
        raise ValueError("--gdb-wait: give the port as well: --gdb PORT")

    def look_at(emulated: AnyEmulated) -> "GdbEndpoint | None":
        files(emulated)
        if args.gdb is None:
            return None
        endpoint = open_gdb(emulated, args.gdb, wait=args.gdb_wait)
        say(f"gdb: target remote {endpoint.name}")
        return endpoint

    return look_at


def record(
    args: argparse.Namespace, emulated: AnyEmulated, stack: Outputs, setup: "Setup | None" = None
) -> "Recorder | None":
    """Start the requested recording and trace before any port is opened; ``stack`` ends them.

    ``setup`` is for the recording's header. Returns what records, if anything. Raises ValueError
    for a file that can not be written.
    """
    if args.trace is not None:
        stack.callback(start_trace(emulated, create_record(args.trace, stack)).close)
    if args.record is None:
        return None
    recorder = start_recorder(emulated, create_record(args.record, stack), setup)
    stack.callback(recorder.close)
    return recorder


def add_line_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which device a target is, and its lines and control port."""
    parser.add_argument(
        "--device", choices=device_names(), help="needed if TARGET does not name it"
    )
    parser.add_argument("--bench", metavar="TARGET", help="serial line with the bench protocol")
    add_value(parser, "baud", whole(None, "baud rate of the serial line", 1))
    parser.add_argument(
        "--control", metavar="URL", help=f"control port of the emulation; its token is in ${TOKEN}"
    )


def add_target_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("target", metavar="TARGET", help=FORMS)
    add_line_arguments(parser)
    add_flag(parser, "--backup", "the serial line speaks the register protocol")
    add_path(parser, "--scene", "for an emulated device")
    add_value(parser, "seed", whole(0, "for an emulated device", 0))
    add_engine_arguments(parser)
    add_board_arguments(parser)
    add_output(parser, "--record", "record the session to FILE")


def open_any_target(text: str, args: argparse.Namespace, *, keep: bool = True) -> Target:
    """Open the target ``text`` with these options; ``keep`` and errors as of ``open_target``."""
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
            engine=args.engine,
            record=args.record,
            control=args.control,
            options=options,
            keep=keep,
        )
    if target.device is not None:
        show_notices(target.device, options, say)
    return target
