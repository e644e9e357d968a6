"""Which pin of the FPGA each channel of a capture is on."""

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.capture.capture import UNKNOWN, Capture, CaptureError, Channel
from cubestack.firmware_model.interface.pins import Pin

LEFT_OUT = "-"
"""As the pin of a channel: the channel is not used."""

_BIT = re.compile(r"(.*?)[_\[(<]?(\d+)[\])>]?")
_RANGE = re.compile(r"(.*?)[\[(<](\d+):(\d+)[\])>]")


class Signal(NamedTuple):
    """A pin as it was captured."""

    times: NDArray[np.int64]  #: of its changes in ps, increasing
    levels: NDArray[np.int64]  #: new levels; bits not in ``known`` are 0
    known: NDArray[np.int64]  #: bits whose level is known
    order: NDArray[np.int64]  #: place of each change in the file

    def at(self, times: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Levels and known bits at ``times``; nothing is known before the first change."""
        place = np.searchsorted(self.times, times, side="right") - 1
        before = place < 0
        return (np.where(before, 0, self.levels[place]), np.where(before, 0, self.known[place]))

    @property
    def bits(self) -> int:
        """Bits that have a known level at any time."""
        return int(np.bitwise_or.reduce(self.known))


def signals(
    capture: Capture, pins: Sequence[Pin], mapping: Mapping[str, str] | None = None
) -> dict[str, Signal]:
    """The captured pins by name; a bus with separate lines is put together.

    A channel has the name of a pin or of a port, with its bit on a bus ("SRAM_A[3]", "SRAM_A3"), or
    ``mapping`` gives it for a channel's name or pattern; ``LEFT_OUT`` drops a channel. Raises
    CaptureError for a channel that is no pin.
    """
    widths = {
        **{port.name: port.width for pin in pins for port in pin.ports},
        **{str(pin): pin.width for pin in pins},
    }
    places: dict[str, list[tuple[int, int]]] = defaultdict(list)  # channel and lowest bit
    taken: dict[tuple[str, int], str] = {}
    unused = dict(mapping or {})
    for number, channel in enumerate(capture.channels):
        given = _mapped(channel, mapping or {}, unused)
        if given == LEFT_OUT:
            continue
        found = _place(given or channel.name, channel.width, widths)
        if found is None:
            raise CaptureError(_unknown(capture.channels, number, given, pins))
        name, bit = found
        for line in range(bit, bit + channel.width):
            other = taken.setdefault((name, line), channel.full_name)
            if other != channel.full_name:
                raise CaptureError(
                    f"channels {other} and {channel.full_name} are both"
                    f" {_line(name, line, widths)};"
                    f" --map {channel.full_name}={LEFT_OUT} leaves one out"
                )
        places[name].append((number, bit))
    if unused:
        raise CaptureError(f"no channel is called {', '.join(unused)}; {_listed(capture.channels)}")
    if not places:
        raise CaptureError(f"no channel is used; {_listed(capture.channels)}")
    return {name: _joined(capture, lines) for name, lines in places.items()}


def _mapped(channel: Channel, mapping: Mapping[str, str], unused: dict[str, str]) -> str | None:
    names = channel.name.upper(), channel.full_name.upper()
    for pattern, pin in mapping.items():
        if any(name == pattern.upper() or fnmatchcase(name, pattern.upper()) for name in names):
            unused.pop(pattern, None)
            return pin
    return None


def _place(name: str, width: int, widths: Mapping[str, int]) -> tuple[str, int] | None:
    """Pin or port and lowest bit of a channel; None if there is no such line."""
    table = {pin.upper(): pin for pin in widths}
    name = name.upper()
    if name in table and widths[table[name]] == width:
        return table[name], 0
    if (found := _RANGE.fullmatch(name)) and found[1] in table:
        high, low = int(found[2]), int(found[3])
        fits = high - low + 1 == width and high < widths[table[found[1]]]
        return (table[found[1]], low) if fits else None
    if width == 1 and (found := _BIT.fullmatch(name)) and found[1] in table:
        bit = int(found[2])
        return (table[found[1]], bit) if bit < widths[table[found[1]]] else None
    return None


def _line(name: str, bit: int, widths: Mapping[str, int]) -> str:
    return name if widths[name] == 1 else f"{name}[{bit}]"


def _unknown(
    channels: Sequence[Channel], number: int, given: str | None, pins: Iterable[Pin]
) -> str:
    channel = channels[number]
    wide = f" of {channel.width} bits" if channel.width > 1 else ""
    names = ", ".join(pin if pin.width == 1 else f"{pin}[{pin.width - 1}:0]" for pin in pins)
    called = f"{channel.full_name}{wide}" + (f" (mapped to {given})" if given else "")
    return (
        f"channel {called} is no pin; the pins are {names};"
        f" --map {channel.full_name}=PIN names one, --map {channel.full_name}={LEFT_OUT}"
        " leaves it out"
    )


def _listed(channels: Sequence[Channel]) -> str:
    return f"the channels are {', '.join(channel.full_name for channel in channels)}"


def _joined(capture: Capture, lines: Sequence[tuple[int, int]]) -> Signal:
    """A signal of several channels, each with its lowest bit."""
    chosen = np.flatnonzero(np.isin(capture.numbers, [number for number, _ in lines]))
    times, first, inverse = np.unique(capture.times[chosen], return_index=True, return_inverse=True)
    levels = np.zeros(len(times), np.int64)
    known = np.zeros(len(times), np.int64)
    for number, bit in lines:
        own = np.flatnonzero(capture.numbers[chosen] == number)
        values = np.full(len(times), UNKNOWN, np.int64)
        here = np.zeros(len(times), bool)
        values[inverse[own]] = capture.levels[chosen[own]]  # the last one of an instant
        here[inverse[own]] = True
        latest = np.maximum.accumulate(np.where(here, np.arange(len(times)), -1))
        filled = np.where(latest < 0, UNKNOWN, values[latest])
        width = capture.channels[number].width
        levels |= np.where(filled < 0, 0, filled) << bit
        known |= np.where(filled < 0, 0, (1 << width) - 1) << bit
    return Signal(times, levels, known, chosen[first])
