"""``emulated:DEVICE`` as a target, beside all that ``host.targets`` opens."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from cubestack.host.cli.arguments import whole
from cubestack.host.cli.boards import DEVICES
from cubestack.host.cli.records import create_file, record
from cubestack.host.errors import TargetError
from cubestack.host.node_client import NodeClient
from cubestack.host.tape import Tape
from cubestack.host.targets import INTERFACES, Target, interface_of, open_target, with_i2c

__all__ = ["add_target_arguments", "open_any_target"]

EMULATED = "emulated:"

CLEAR = "clear"
"""Ends all faults."""

TIMES = ("at_s", "for_s")
"""When a fault begins, and how long it lasts."""

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

    Raises what ``host.targets.open_target`` does, and ValueError for a scene that is none.
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
            tape = Tape(create_file(args.record, stack))
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
    from cubestack.host.cli.boards import open_board

    opened = open_board(device, scene, seed=seed, engine="auto", baud=baud)
    board = opened.board
    interface = interface_of(device, text)
    stack = ExitStack()
    stack.callback(board.close)
    record(argparse.Namespace(record=path, trace=None), opened, stack)
    lines = [DirectSerial(board.kernel, line.uart) for line in opened.lines]
    target = Target(text, interface, NodeClient(lines[0], interface), lines[0])
    target.on_close.append(stack.close)
    bus = DirectI2c(board.kernel, board.i2c_bus)
    target.registers = with_i2c(target, bus, bus.wait)
    if interface.bench is not None and len(lines) > 1:
        target.bench = lines[1]
    target.controls = _BoardControls(board, device)
    return target


class _BoardControls:
    """See ``host.targets.Controls``."""

    def __init__(self, board: Any, device: str) -> None:
        self._board = board
        self._device = device
        self.channels = tuple(board.power.table.channels)
        from cubestack.emulator.faults.table import FAULTS

        self.faults = (
            *(
                f"{kind} {target}"
                for kind, fault in FAULTS.items()
                for target in board.faults.targets(fault.site)
            ),
            CLEAR,
        )

    def fault(self, words: list[str]) -> None:
        if words == [CLEAR]:
            self._board.faults.clear()
            return
        kind, *rest = words
        given = dict(word.split("=", 1) for word in rest if "=" in word)
        targets = [word for word in rest if "=" not in word]
        if len(targets) > 1:
            raise TargetError(f"fault {kind}: one target, not {' '.join(targets)}")
        times = {name: _seconds(given.pop(name)) for name in TIMES if name in given}
        if "target" in given:
            targets.append(given.pop("target"))
        if "fault" in given:
            raise TargetError(f"fault {kind}: no parameter 'fault'")
        parameters = {name: _parameter(text) for name, text in given.items()}
        self._board.faults.inject(
            kind, target=targets[0] if targets else None, **times, **parameters
        )

    def scene(self, path: Path) -> None:
        try:
            if self._device == "cubestar":
                from cubestack.emulator.sky.scene import load_scene

                self._board.camera.scene = load_scene(path)
            elif self._device == "cubesense":
                from cubestack.emulator.sky.earth_sun_file import load_earth_sun_scene

                self._board.scene = load_earth_sun_scene(path)
            else:
                raise TargetError(f"the scene of {self._device} can not be changed while it runs")
        except FileNotFoundError:
            raise TargetError(f"no scene file {path}") from None

    def currents(self) -> dict[str, float]:
        power = self._board.power
        return {"total": power.current_ma()} | {
            channel: power.current_ma(channel) for channel in self.channels
        }

    def switch(self, channel: str, on: bool) -> None:
        if channel not in self.channels:
            raise TargetError(f"no channel {channel!r}; known: {', '.join(self.channels)}")
        self._board.power.switch(channel, on)

    def time_s(self) -> float:
        return float(self._board.kernel.now / 1e12)

    def advance(self, seconds: float) -> None:
        self._board.kernel.advance_to(self._board.kernel.now + round(seconds * 1e12))


def _seconds(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise TargetError(f"{text!r} is not a number of seconds") from None


def _parameter(text: str) -> Any:
    """A number, true or false, or a word."""
    for convert in (int, float):
        try:
            return convert(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text.lower(), text)
