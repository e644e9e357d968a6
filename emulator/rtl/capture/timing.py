"""Times between edges at the pins, as captured and as emulated, against the limits of the SRAM."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.capture.pins import Signal
from cubestack.emulator.rtl.capture.replay import bus_of
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import MemoryPins, Wiring

Times = NDArray[np.int64]

_GAP = 4
"""Periods of a clock, in units of the median, from which on it has stopped."""


class Wave(NamedTuple):
    """Changes of a pin."""

    times: Times
    levels: NDArray[np.int64]

    def rises(self) -> Times:
        return self._edges(1)

    def falls(self) -> Times:
        return self._edges(0)

    def _edges(self, level: int) -> Times:
        moved = np.flatnonzero(self.levels[1:] != self.levels[:-1]) + 1
        chosen: Times = self.times[moved[self.levels[moved] == level]]
        return chosen

    def moves(self) -> Times:
        return self.times[np.flatnonzero(np.diff(self.levels) != 0) + 1]


class Interval(NamedTuple):
    """Times of one kind between two edges."""

    name: str
    found_ps: Times
    least_ps: int | None = None  #: limit of the memory's data sheet, if it has one


def captured_waves(captured: Mapping[str, Signal]) -> dict[str, Wave]:
    return {name: Wave(signal.times, signal.levels) for name, signal in captured.items()}


def intervals(wiring: Wiring, waves: Mapping[str, Wave], limits: SramTiming) -> Iterator[Interval]:
    """Those between pins in ``waves``; ones that never happen are left out."""
    every = (*_clocks(wiring, waves), *_outputs(wiring, waves))
    for memory in wiring.memories:
        every += tuple(_memory(wiring, memory, waves, limits))
    yield from (interval for interval in every if len(interval.found_ps))


def _clocks(wiring: Wiring, waves: Mapping[str, Wave]) -> Iterator[Interval]:
    clocks = [camera.clock for camera in wiring.cameras]
    for name in [*clocks, wiring.data_clock]:
        if name in waves and len(periods := np.diff(waves[name].rises())):
            running = periods[periods < _GAP * np.median(periods)]
            yield Interval(f"{name} period", running)


def _outputs(wiring: Wiring, waves: Mapping[str, Wave]) -> Iterator[Interval]:
    for ack in wiring.acknowledges:
        for camera in wiring.cameras:
            if {ack, camera.clock, camera.line} <= waves.keys():
                clocked = waves[camera.clock].rises()
                line = waves[camera.line]
                place = np.searchsorted(line.times, clocked, side="right") - 1
                pixels = clocked[(place >= 0) & (line.levels[place] == 1)]
                yield Interval(
                    f"last pixel of {camera.name} to {ack}", _since(waves[ack].rises(), pixels)
                )
    if {wiring.data_clock, wiring.data} <= waves.keys():
        clocked = waves[wiring.data_clock].rises()
        found = _since(waves[wiring.data].moves(), clocked)
        # A later change has another cause.
        found = found[found < np.diff(clocked).min(initial=np.iinfo(np.int64).max)]
        yield Interval(f"{wiring.data_clock} to {wiring.data}", found)


def _memory(
    wiring: Wiring, memory: MemoryPins, waves: Mapping[str, Wave], limits: SramTiming
) -> Iterator[Interval]:
    address, data = waves.get(memory["A"]), waves.get(bus_of(memory))
    write, enable = waves.get(memory["WE_N"]), waves.get(memory["OE_N"])
    name = memory["WE_N"]
    if write is not None:
        falls, rises = write.falls(), write.rises()
        yield Interval(f"{name} pulse", _since(rises, falls), limits.write_pulse_ps)
        if address is not None:
            moves = address.moves()
            yield Interval(f"{memory['A']} before {name} falls", _since(falls, moves), 0)
            yield Interval(f"{memory['A']} after {name} rises", _until(rises, moves), 0)
        if data is not None:
            limit = limits.data_setup_ps
            yield Interval(
                f"{bus_of(memory)} before {name} rises",
                _since(rises, data.moves(), strictly=True),
                limit,
            )
    if wiring.data_clock in waves and enable is not None:
        clocked = waves[wiring.data_clock].rises()
        place = np.searchsorted(enable.times, clocked, side="left") - 1
        clocked = clocked[(place >= 0) & (enable.levels[place] == 0)]
        if address is not None:
            yield Interval(
                f"{memory['A']} before {wiring.data_clock}",
                _since(clocked, address.moves(), strictly=True),
                limits.access_ps,
            )


def _since(ends: Times, begins: Times, strictly: bool = False) -> Times:
    """Time from the latest of ``begins`` to each of ``ends`` that has one."""
    place = np.searchsorted(begins, ends, side="left" if strictly else "right") - 1
    return ends[place >= 0] - begins[place[place >= 0]]


def _until(begins: Times, ends: Times) -> Times:
    place = np.searchsorted(ends, begins, side="left")
    found = place < len(ends)
    return ends[place[found]] - begins[found]
