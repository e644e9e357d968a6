"""A microcontroller's commands to a board, on an engine and pin by pin in Icarus Verilog."""

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cubestack.emulator.rtl.contract import PinEvent, RtlEngine
from cubestack.emulator.rtl.wiring import CameraPins, Wiring
from cubestack.hdl.flow.generate import verilog_text
from tests.hdl.engines.icarus_board import IcarusBoard

from .cameras import ListCamera

Command = tuple[int, str, int]
"""At a time in ps: a pin takes a level, or "strobe" reads bytes."""


class Outcome(NamedTuple):
    memories: dict[str, bytes]
    data: bytes
    acks: list[int]  #: Times in ps at which the acknowledge that was watched rose


def run_engine(
    engine: RtlEngine,
    cameras: Mapping[str, ListCamera],
    commands: Sequence[Command],
    strobe_ps: int,
    watched: str = "ACK",
) -> Outcome:
    """Play ``commands``, with a byte each ``strobe_ps``; the engine stops as ``watched`` rises."""
    for name, camera in cameras.items():
        engine.attach(camera, name)
    data, acks = b"", []

    def advance(until_ps: int) -> None:
        if not engine.get_pin(watched):
            engine.run(until_ps, (watched, 1))
            if engine.get_pin(watched):
                acks.append(engine.now_ps)
        engine.run(until_ps)

    for time_ps, name, value in commands:
        advance(time_ps)
        if name == "strobe":
            out = np.zeros(value, np.uint8)
            made = engine.strobe_read(out, Fraction(strobe_ps), time_ps + value * strobe_ps)
            assert made == value
            data += out.tobytes()
        else:
            engine.set_pin(name, value)
    return Outcome({name: m.tobytes() for name, m in engine.memories.items()}, data, acks)


class CommandedIcarus:
    """The Verilog of a wiring's top between its memories, compiled once."""

    def __init__(self, folder: Path, wiring: Wiring, strobe_ps: int) -> None:
        self._wiring = wiring
        self._strobe_ps = strobe_ps
        verilog = verilog_text(wiring.component)
        self._watched = (*wiring.acknowledges, wiring.data)
        self._icarus = IcarusBoard(folder, wiring, verilog, self._watched)

    def run(
        self, cameras: Mapping[str, ListCamera], commands: Sequence[Command]
    ) -> dict[str, Outcome]:
        """The outcome for each acknowledge; a camera that is not there has no clock."""
        events = sorted(self._events(cameras, commands), key=lambda event: event.time_ps)
        played = self._icarus.play(events)
        levels = dict(zip(self._watched, played.outputs.T, strict=True))
        # What is there when the clock falls.
        falls = [
            n for n, e in enumerate(events) if e.pin == self._wiring.data_clock and not e.level
        ]
        data = levels[self._wiring.data][np.array(falls, np.intp) - 1].astype(np.uint8).tobytes()
        return {
            pin: Outcome(played.memories, data, [events[n].time_ps for n in rises(levels[pin])])
            for pin in self._wiring.acknowledges
        }

    def _events(
        self, cameras: Mapping[str, ListCamera], commands: Sequence[Command]
    ) -> Iterator[PinEvent]:
        for pins in self._wiring.cameras:
            if pins.name in cameras:
                yield from camera_events(pins, cameras[pins.name])
        for time_ps, name, value in commands:
            if name == "strobe":
                for edge in range(2 * value):
                    at_ps = time_ps + edge * self._strobe_ps // 2
                    yield PinEvent(at_ps, self._wiring.data_clock, 1 - edge % 2)
            else:
                yield PinEvent(time_ps, name, value)


def rises(levels: np.ndarray) -> list[int]:
    """Where levels go from 0 to 1."""
    return np.flatnonzero(np.diff(levels, prepend=0) == 1).tolist()


def camera_events(pins: CameraPins, camera: ListCamera) -> Iterator[PinEvent]:
    """Edge k of a segment at floor(start + k * period / 2); levels change as the clock falls."""
    now_ps, before = 0, dict.fromkeys(pins.pins, 0)

    def drive(levels: dict[str, int]) -> Iterator[PinEvent]:
        for pin, level in levels.items():
            if pin in before and before[pin] != level:
                before[pin] = level
                yield PinEvent(now_ps, pin, level)

    numerator, denominator = camera.period.numerator, 2 * camera.period.denominator
    for segment in camera.segments:
        image = segment.pixels().tolist() if segment.pixels else []
        for clock in range(segment.clocks):
            row, column = divmod(clock, camera.line_clocks)
            sent = bool(image) and column < camera.active_columns
            pixel = image[row][column] if sent else 0
            yield from drive({pins.frame or "": segment.vsync, pins.line: sent, pins.data: pixel})
            for edge, level in ((2 * clock, 1), (2 * clock + 1, 0)):
                now_ps = segment.start_ps + edge * numerator // denominator
                yield from drive({pins.clock: level})
    yield from drive(dict.fromkeys(pins.pins, 0))
