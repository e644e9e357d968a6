"""What can be done to an emulated device from outside of its ports, by shell or replay."""

from collections.abc import Callable, Mapping
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
    """What can be done to an emulated device past its ports, wherever it is emulated.

    Attributes:
        channels: supply channels.
        faults: what ``fault`` takes: kind and target, and `CLEAR`.
        fault_parameters: names of parameters by kind.
    """

    channels: tuple[str, ...]
    faults: tuple[str, ...]
    fault_parameters: Mapping[str, tuple[str, ...]]

    def fault(self, words: list[str]) -> None:
        """Let something break; ValueError for what is not in ``faults``."""

    def fault_log(self) -> list[str]:
        """A line for each thing that faults have done, with its virtual time."""

    def scene(self, path: Path) -> None:
        """Show the scene in a file; ValueError for one that is none."""

    def currents(self) -> dict[str, float]:
        """Supply currents in mA: all, and each channel's."""

    def switch(self, channel: str, on: bool) -> None:
        """Switch a channel; ValueError for an unknown one."""

    def peek(self, what: str) -> dict[str, tuple[int | None, str]]:
        """Words of the processor that runs own firmware, with a text each, by name.

        ValueError for what is not there.
        """

    def time_s(self) -> float: ...

    def advance(self, seconds: float) -> None: ...


def spoken(kinds: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Words of ``fault`` for all kinds at their targets."""
    return (*(f"{kind} {target}" for kind, at in kinds.items() for target in at), CLEAR)


class EmulatedControls:
    """Faults, scene, load switches and time of an emulated device, in a shell's words.

    Attributes:
        on_act: told of what was done: the words of the shell, and the text of a file that they
            name.
    """

    def __init__(self, emulated: AnyEmulated) -> None:
        from cubestack.emulator.faults.declaration import TIMES
        from cubestack.emulator.faults.table import FAULTS

        self.on_act: Callable[[tuple[str, ...], str], None] = lambda _words, _text: None
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
        """Do what a recording has; ValueError for what can not be done."""
        match control.words:
            case ("fault", *words) if words:
                self.fault(words)
            case ("scene", name):
                with written(Document(name, control.text)) as path:
                    try:
                        self._emulated.scene = path
                    except ValueError as error:
                        raise ValueError(str(error).replace(str(path), name)) from None
                self.on_act(control.words, control.text)
            case ("power", channel, "on" | "off" as state):
                self.switch(channel, state == "on")
            case _:
                raise TargetError(f"nothing does {' '.join(control.words)!r}")

    def fault(self, words: list[str]) -> None:
        """Let something break; ValueError for what is not in ``faults``."""
        if words == [CLEAR]:
            self._board.faults.clear()
        else:
            self._board.faults.inject_words(words)
        self.on_act(("fault", *words), "")

    def fault_log(self) -> list[str]:
        """A line for each thing that faults have done, with its virtual time."""
        return [str(event) for event in self._board.faults.log]

    def scene(self, path: Path) -> None:
        """Show the scene in a file; ValueError for one that is none."""
        try:
            self._emulated.scene = path
        except FileNotFoundError:
            raise TargetError(f"no scene file {path}") from None
        self.on_act(("scene", str(path)), read_document(path).text)

    def currents(self) -> dict[str, float]:
        """Supply currents in mA: all, and each channel's."""
        power = self._board.power
        return {"total": power.current_ma()} | {
            channel: power.current_ma(channel) for channel in self.channels
        }

    def switch(self, channel: str, on: bool) -> None:
        """Switch a channel; ValueError for an unknown one."""
        if channel not in self.channels:
            raise TargetError(f"no channel {channel!r}; known: {', '.join(self.channels)}")
        self._board.power.switch(channel, on)
        self.on_act(("power", channel, "on" if on else "off"), "")

    def peek(self, what: str) -> dict[str, tuple[int | None, str]]:
        """Words of the processor that runs own firmware, with a text each, by name.

        ValueError for what is not there.
        """
        from cubestack.emulator.boards.processor_registers import peek

        insight = self._board.insight
        if insight is None:
            raise TargetError("peek: this device runs no firmware of its own: give --firmware")
        found = peek(insight.machine, insight.symbols, what)
        return {one.name: (one.value, one.text) for one in found}

    def time_s(self) -> float:
        return self._emulated.time_s

    def advance(self, seconds: float) -> None:
        self._emulated.wait(seconds)
