"""What can be done to an emulated device from outside of its ports, by shell or replay."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cubestack.firmware_model.formats.recording import Control
from cubestack.firmware_model.formats.setup import Document
from cubestack.host.errors import TargetError
from cubestack.host.recording.setups import read_document, written

__all__ = ["BoardControls"]

CLEAR = "clear"
"""Ends all faults."""

TIMES = ("at_s", "for_s")
"""When a fault begins, and how long it lasts."""


class BoardControls:
    """See ``host.devices.targets.Controls``.

    Attributes:
        on_act: told of what was done: the words of the shell, and the text of a file that they
            name.
    """

    def __init__(self, board: Any, device: str) -> None:
        """Control ``board``, a ``device`` of ``host.devices.boards``."""
        self.on_act: Callable[[tuple[str, ...], str], None] = lambda _words, _text: None
        self._board = board
        self._device = device
        self.channels = tuple(board.power.table.channels)
        from cubestack.emulator.faults.table import FAULTS

        kinds = board.faults.kinds()
        self.faults = (
            *(f"{kind} {target}" for kind, targets in kinds.items() for target in targets),
            CLEAR,
        )
        self.fault_parameters: Mapping[str, tuple[str, ...]] = {
            kind: (*FAULTS[kind].parameters(), *TIMES[: 1 if FAULTS[kind].momentary else 2])
            for kind in kinds
        }

    def act(self, control: Control) -> None:
        """Do what a recording has; ValueError for what can not be done."""
        match control.words:
            case ("fault", *words) if words:
                self.fault(words)
            case ("scene", name):
                with written(Document(name, control.text)) as path:
                    self._show(path)
                self.on_act(control.words, control.text)
            case ("power", channel, "on" | "off" as state):
                self.switch(channel, state == "on")
            case _:
                raise TargetError(f"nothing does {' '.join(control.words)!r}")

    def fault(self, words: list[str]) -> None:
        """See Controls."""
        if words == [CLEAR]:
            self._board.faults.clear()
        else:
            self._inject(words)
        self.on_act(("fault", *words), "")

    def fault_log(self) -> list[str]:
        """See Controls."""
        return [str(event) for event in self._board.faults.log]

    def _inject(self, words: list[str]) -> None:
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
        """See Controls."""
        try:
            self._show(path)
        except FileNotFoundError:
            raise TargetError(f"no scene file {path}") from None
        self.on_act(("scene", str(path)), read_document(path).text)

    def _show(self, path: Path) -> None:
        if self._device == "cubestar":
            from cubestack.emulator.scene.sky import load_scene

            self._board.camera.scene = load_scene(path)
        elif self._device == "cubesense":
            from cubestack.emulator.scene.earth_sun_file import load_earth_sun_scene

            self._board.scene = load_earth_sun_scene(path)
        else:
            raise TargetError(f"the scene of {self._device} can not be changed while it runs")

    def currents(self) -> dict[str, float]:
        """See Controls."""
        power = self._board.power
        return {"total": power.current_ma()} | {
            channel: power.current_ma(channel) for channel in self.channels
        }

    def switch(self, channel: str, on: bool) -> None:
        """See Controls."""
        if channel not in self.channels:
            raise TargetError(f"no channel {channel!r}; known: {', '.join(self.channels)}")
        self._board.power.switch(channel, on)
        self.on_act(("power", channel, "on" if on else "off"), "")

    def time_s(self) -> float:
        """See Controls."""
        return float(self._board.kernel.now / 1e12)

    def advance(self, seconds: float) -> None:
        """See Controls."""
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
