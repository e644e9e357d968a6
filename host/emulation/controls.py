"""Actions on an emulated device other than by its ports, for shell and replay."""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from cubestack.firmware_model.formats.recording import Control
from cubestack.firmware_model.formats.setup import Document
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.errors import TargetError
from cubestack.host.recording.setups import read_document, written

CLEAR = "clear"
"""Ends all faults."""


class Controls(Protocol):
    """Actions on an emulated device, in this process or another."""

    channels: tuple[str, ...]  #: supply channels
    faults: tuple[str, ...]  #: what ``fault`` takes: kind and target, and `CLEAR`
    fault_parameters: Mapping[str, tuple[str, ...]]  #: names of parameters by kind

    def fault(self, words: list[str]) -> None:
        """Inject a fault; raises ValueError unless it is in ``faults``."""

    def fault_log(self) -> list[str]:
        """The fault events, a line each with its virtual time."""

    def scene(self, path: Path) -> None:
        """Load a scene file; raises ValueError if it is invalid."""

    def point(self, words: list[str]) -> None:
        """Give it another attitude, from ``NAME=VALUE`` words; raises ValueError if invalid."""

    def currents(self) -> dict[str, float]:
        """Supply currents in mA: all, and each channel's."""

    def switch(self, channel: str, on: bool) -> None:
        """Switch a channel; ValueError for an unknown one."""

    def peek(self, what: str) -> dict[str, tuple[int | None, str]]:
        """Memory words of the processor that runs the user's firmware, each with a text, by name.

        Raises ValueError for an unknown name.
        """

    def time_s(self) -> float: ...

    def advance(self, seconds: float) -> None: ...


def spoken(kinds: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Arguments of ``fault`` for all kinds and their targets."""
    return (*(f"{kind} {target}" for kind, at in kinds.items() for target in at), CLEAR)


class EmulatedControls:
    """``Controls`` of a device emulated in this process."""

    def __init__(self, emulated: AnyEmulated) -> None:
        from cubestack.emulator.faults.declaration import TIMES
        from cubestack.emulator.faults.table import FAULTS

        self._emulated = emulated
        board = self._board = emulated.board
        self.channels = tuple(board.power.table.channels)
        kinds = board.faults.kinds()
        self.faults = spoken(kinds)
        self.fault_parameters: Mapping[str, tuple[str, ...]] = {
            kind: (*FAULTS[kind].declared(), *([*TIMES][:1] if FAULTS[kind].momentary else TIMES))
            for kind in kinds
        }

    def act(self, control: Control) -> None:
        """Perform an action of a recording; raises ValueError if it is not possible."""
        match control.words:
            case ("fault", *words) if words:
                self.fault(words)
            case ("scene", name):
                files = {**self._emulated.files, **control.files}
                with written(Document(name, control.text, files)) as path:
                    self._emulated.scene = path
                self._emulated.on_act(control.words, control.text, self._emulated.files)
            case ("point", *words):
                self.point(words)
            case ("power", channel, "on" | "off" as state):
                self.switch(channel, state == "on")
            case ("pin", pin, "0" | "1" | "z" as level):
                self.drive(pin, None if level == "z" else int(level))
            case _:
                raise TargetError(f"nothing does {' '.join(control.words)!r}")

    def fault(self, words: list[str]) -> None:
        if words == [CLEAR]:
            self._board.faults.clear()
        else:
            self._board.faults.inject_words(words)
        self._emulated.on_act(("fault", *words), "")

    def fault_log(self) -> list[str]:
        return [str(event) for event in self._board.faults.log]

    def scene(self, path: Path) -> None:
        try:
            self._emulated.scene = path
        except FileNotFoundError:
            raise TargetError(f"no scene file {path}") from None
        document = read_document(path)
        self._emulated.on_act(("scene", document.name), document.text, document.files)

    def point(self, words: list[str]) -> None:
        from cubestack.emulator.scene.pointing import Pointing

        self._emulated.follow(Pointing.parse(words))

    def currents(self) -> dict[str, float]:
        power = self._board.power
        return {"total": power.current_ma()} | {
            channel: power.current_ma(channel) for channel in self.channels
        }

    def switch(self, channel: str, on: bool) -> None:
        if channel not in self.channels:
            raise TargetError(f"no channel {channel!r}; known: {', '.join(self.channels)}")
        self._board.power.switch(channel, on)
        self._emulated.on_act(("power", channel, "on" if on else "off"), "")

    def drive(self, pin: str, level: int | None) -> None:
        """Drive a pin of a bare part from outside; None releases it."""
        pins = self._emulated.pins
        if level is None:
            del pins[pin]
        else:
            pins[pin] = level
        self._emulated.on_act(("pin", pin, "z" if level is None else str(level)), "")

    def peek(self, what: str) -> dict[str, tuple[int | None, str]]:
        from cubestack.emulator.boards.monitor import peek

        insight = self._board.insight
        if insight is None:
            raise TargetError("peek: this device runs no own firmware; start it with --firmware")
        found = peek(insight.machine, insight.symbols, what)
        return {one.name: (one.value, one.text) for one in found}

    def time_s(self) -> float:
        return self._emulated.time_s

    def advance(self, seconds: float) -> None:
        self._emulated.wait(seconds)
