"""Compares captured outputs with the emulated ones."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.capture.pins import Signal
from cubestack.emulator.rtl.capture.replay import Emulated, Levels, bus_of, reads
from cubestack.emulator.rtl.wiring import Wiring


class Expected(NamedTuple):
    """An output of the emulated FPGA, as it can be captured."""

    levels: Levels  #: at the times of ``Emulated``
    comparable: Levels  #: bits that are known and driven


class Difference(NamedTuple):
    """A captured output that differs for longer than the tolerance."""

    time_ps: int  #: where it begins
    end_ps: int
    pin: str
    captured: int  #: levels once the tolerance is over
    emulated: int
    bits: int  #: the bits that differ at that time


@dataclass(frozen=True)
class Comparison:
    """Results for each compared pin.

    Attributes:
        bits: compared bits by pin.
        differences: all, ordered by time.
    """

    bits: Mapping[str, int]
    differences: Sequence[Difference]

    @property
    def counts(self) -> dict[str, int]:
        found = dict.fromkeys(self.bits, 0)
        for difference in self.differences:
            found[difference.pin] += 1
        return found


def expected_outputs(
    wiring: Wiring, captured: Mapping[str, Signal], emulated: Emulated
) -> dict[str, Expected]:
    """The emulated counterpart of each captured pin that the FPGA or a memory drives."""
    memories = {bus_of(memory): memory for memory in wiring.memories}
    pins = {str(pin): pin for pin in wiring.component.pins}
    ports = {port.name: port for pin in pins.values() for port in pin.ports}
    found = {}
    for name in captured:
        memory = memories.get(name, memories.get(name.removesuffix("_I")))
        if memory is not None and name in (bus_of(memory), memory["D_I"]):
            driven = reads(memory, emulated.levels)
            if name == bus_of(memory):
                driven |= emulated.levels[memory["D_OE"]] != 0
            port, mask = memory["D_I"], np.where(driven, -1, 0)
        elif name in pins and (level := pins[name].level_out) is not None:
            port, mask = level, np.full(len(emulated.times), -1)
            if (enable := pins[name].enable) is not None:
                oe = emulated.levels[enable] & emulated.known[enable]
                mask = np.where(oe & 1, -1, 0) if ports[enable].width == 1 else oe
        elif name in ports and ports[name].output:
            port, mask = name, np.full(len(emulated.times), -1)
        else:
            continue
        found[name] = Expected(emulated.levels[port], emulated.known[port] & mask)
    return found


def compare(
    captured: Mapping[str, Signal],
    outputs: Mapping[str, Expected],
    times: Levels,
    end_ps: int,
    skew_ps: int,
) -> Comparison:
    """Compare each pin; levels may differ for up to ``skew_ps`` at a time."""
    bits = {}
    differences: list[Difference] = []
    for pin, output in outputs.items():
        bits[pin] = int(np.bitwise_or.reduce(output.comparable)) & captured[pin].bits
        differences += _differences(pin, captured[pin], output, times, end_ps, skew_ps)
    return Comparison(bits, sorted(differences))


def _differences(
    pin: str, signal: Signal, output: Expected, times: Levels, end_ps: int, skew_ps: int
) -> Iterator[Difference]:
    moved = np.flatnonzero(_changes(output.levels) | _changes(output.comparable))
    moments = np.union1d(signal.times, times[moved])

    def at(moment: Levels) -> tuple[Levels, Levels, Levels]:
        place = np.searchsorted(times, moment, side="right") - 1
        levels, known = signal.at(moment)
        mask = np.where(place < 0, 0, output.comparable[place]) & known
        return levels, output.levels[place], mask

    levels, wanted, mask = at(moments)
    wrong = np.concatenate([[False], ((levels ^ wanted) & mask) != 0, [False]])
    edges = np.diff(wrong.astype(np.int8))
    bounds = np.append(moments, max(end_ps, int(moments[-1]) if len(moments) else 0))
    begins, ends = bounds[np.flatnonzero(edges == 1)], bounds[np.flatnonzero(edges == -1)]
    long = ends - begins > skew_ps
    begins, ends = begins[long], ends[long]
    levels, wanted, mask = at(begins + skew_ps)
    rows = zip(*(array.tolist() for array in (begins, ends, levels, wanted, mask)), strict=True)
    for begin, end, level, want, bits in rows:
        yield Difference(begin, end, pin, level, want, (level ^ want) & bits)


def _changes(levels: Levels) -> NDArray[np.bool_]:
    return np.asarray(np.diff(levels, prepend=levels[:1] ^ 1) != 0)
