"""``emulated:DEVICE`` as a target, beside all that ``host.devices.targets`` opens."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path

from cubestack.host.cli.arguments import whole
from cubestack.host.cli.records import create_file, record
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.boards import DEVICES
from cubestack.host.devices.controls import BoardControls
from cubestack.host.devices.targets import INTERFACES, Target, interface_of, open_target, with_i2c
from cubestack.host.errors import TargetError
from cubestack.host.recording.host_recorder import HostRecorder
from cubestack.host.recording.setups import emulated_setup, taped_setup

__all__ = ["add_target_arguments", "open_any_target"]

EMULATED = "emulated:"

TARGETS = (
    "a serial port, tcp://HOST:PORT, rfc2217://HOST:PORT, i2c:BUS:ADDR, emulated:DEVICE, "
    "recorded:FILE"
)


def add_target_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options that say how a target is opened."""
    parser.add_argument("--device", choices=INTERFACES, help="where the target does not tell")
    parser.add_argument("--bench", metavar="TARGET", help="serial line with the bench protocol")
    parser.add_argument("--baud", type=whole(1), help="of the node protocol's line")
    parser.add_argument("--scene", type=Path, metavar="FILE", help="of an emulated device")
    parser.add_argument("--seed", type=whole(0), default=0, help="of an emulated device")
    parser.add_argument("--record", type=Path, metavar="FILE", help="what is said, to a recording")


def open_any_target(text: str, args: argparse.Namespace) -> Target:
    """Open the target ``text`` with the options of ``add_target_arguments``.

    Raises what ``host.devices.targets.open_target`` does, and ValueError for a scene that is none.
    """
    if not text.startswith(EMULATED):
        if args.scene is not None:
            raise TargetError(f"--scene is for emulated:DEVICE, not for {text}")
        return _open_taped(text, args)
    device = text.removeprefix(EMULATED).lower()
    if device not in DEVICES:
        known = ", ".join(EMULATED + name for name in DEVICES)
        raise TargetError(f"no device {device!r} can be emulated; known: {known}")
    if args.bench is not None:
        raise TargetError(f"{text} has its bench protocol already: leave out --bench")
    return open_emulated(text, device, args.scene, seed=args.seed, baud=args.baud, path=args.record)


def _open_taped(text: str, args: argparse.Namespace) -> Target:
    with ExitStack() as stack:
        tape = None
        if args.record is not None:
            tape = HostRecorder(create_file(args.record, stack), taped_setup(text))
        target = open_target(text, args.device, bench=args.bench, baud=args.baud, tape=tape)
        target.on_close.insert(0, stack.pop_all().close)
        return target


def open_emulated(
    text: str,
    device: str,
    scene: Path | None,
    *,
    seed: int = 0,
    baud: int | None = None,
    path: Path | None = None,
) -> Target:
    """Power up ``device`` in this process; time passes while the host waits.

    ``path`` is of a recording, which is made at the device's pins.
    """
    from cubestack.emulator.ports.direct import DirectI2c, DirectSerial
    from cubestack.host.devices.boards import open_board

    opened = open_board(device, scene, seed=seed, engine="auto", baud=baud)
    board = opened.board
    interface = interface_of(device, text)
    stack = ExitStack()
    stack.callback(board.close)
    controls = BoardControls(board, device)
    setup = None if path is None else emulated_setup(seed, scene)
    recorder = record(argparse.Namespace(record=path, trace=None), opened, stack, setup)
    if recorder is not None:
        controls.on_act = lambda words, text: recorder.control(board.kernel.now, words, text)
    lines = [DirectSerial(board.kernel, line.uart) for line in board.lines]
    target = Target(text, interface, NodeClient(lines[0], interface), lines[0])
    target.on_close.append(stack.close)
    bus = DirectI2c(board.kernel, board.i2c_bus)
    target.registers = with_i2c(target, bus, bus.wait)
    if interface.bench is not None and len(lines) > 1:
        target.bench = lines[1]
    target.controls = controls
    return target
