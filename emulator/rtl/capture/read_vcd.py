"""Reads VCD files (IEEE 1364-2005, section 18), as logic analysers and simulators write them.

pyvcd's reader takes a minute for a capture of 10 MB; this one splits blocks of the file into words.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from cubestack.emulator.rtl.capture.capture import (
    LATEST_PS,
    UNKNOWN,
    WIDEST,
    Capture,
    CaptureError,
    Channel,
    rate_period_ps,
)
from cubestack.firmware_model.formats.untrusted import LARGEST_FILE, opened

_BLOCK = 1 << 20

_UNITS_PS = {"s": 1e12, "ms": 1e9, "us": 1e6, "ns": 1e3, "ps": 1.0, "fs": 1e-3}

_RATE = re.compile(r"\bat ([0-9.]+ [kMG]?Hz)")
"""sigrok's comment: "Acquisition with 8/8 channels at 24 MHz"."""

_NO_LEVEL = {"real", "realtime", "string", "event", "parameter"}

_IGNORED = {b"$dumpvars", b"$dumpall", b"$dumpon", b"$dumpoff", b"$end"}


def read_vcd(path: Path) -> Capture:
    """Raises CaptureError for a file that is none or is damaged."""
    with opened(path, LARGEST_FILE, CaptureError) as stream:
        words = _words(stream)
        try:
            return _Reader(path).read(words)
        except StopIteration:
            raise CaptureError(f"{path} is no VCD file: it has no $enddefinitions") from None


def _words(stream: IO[bytes]) -> Iterator[bytes]:
    """The words of a file, which is never whole in memory."""
    rest = b""
    while block := stream.read(_BLOCK):
        block = rest + block
        cut = max(block.rfind(b"\n"), block.rfind(b" ")) + 1
        rest = block[cut:]
        yield from block[:cut].split()
        if len(rest) > _BLOCK:
            break  # one word of a megabyte: no VCD file
    yield from rest.split()


class _Reader:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._unit_ps: float | None = None
        self._sample_ps: float | None = None
        self._channels: list[Channel] = []
        self._numbers: dict[bytes, tuple[int, ...]] = {}  # of the channels with an identifier

    def read(self, words: Iterator[bytes]) -> Capture:
        self._read_header(words)
        times: list[int] = []
        numbers: list[int] = []
        levels: list[int] = []
        single = {  # scalar changes by their whole word
            level + code: (found, value)
            for code, found in self._numbers.items()
            for level, value in (
                (b"0", 0),
                (b"1", 1),
                *((x, UNKNOWN) for x in (b"x", b"X", b"z", b"Z")),
            )
        }
        now, latest = 0, 0
        for word in words:
            if (change := single.get(word)) is not None:
                for number in change[0]:
                    times.append(now)
                    numbers.append(number)
                    levels.append(change[1])
                continue
            match word[:1]:
                case b"#":
                    now = self._time(word)
                    if now < latest:
                        raise self._damaged(latest, word, "the time goes back")
                    latest = now
                case b"b" | b"B":
                    level = self._level(word, now)
                    code = next(words, b"")
                    for number in self._known(code, now):
                        times.append(now)
                        numbers.append(number)
                        levels.append(level if self._channels[number].width <= WIDEST else UNKNOWN)
                case b"r" | b"R" | b"s" | b"S":
                    self._known(next(words, b""), now)
                case b"$" if word == b"$comment":
                    while next(words, b"$end") != b"$end":
                        pass
                case _:
                    if word not in _IGNORED:
                        raise self._damaged(now, word, "no change of a declared variable")
        if not times:
            raise CaptureError(f"{self._path} has no changes")
        unit = self._unit_ps or 0.0
        return Capture(
            tuple(self._channels),
            np.round(np.array(times, np.int64) * unit).astype(np.int64),
            np.array(numbers, np.int32),
            np.array(levels, np.int64),
            round(latest * unit),
            self._sample_ps,
        )

    def _read_header(self, words: Iterator[bytes]) -> None:
        scopes: list[str] = []
        while (word := next(words)) != b"$enddefinitions":
            if not word.startswith(b"$"):
                raise CaptureError(f"{self._path} is no VCD file: {_shown(word)} is in its head")
            parts: list[str] = []
            while (part := next(words)) != b"$end":
                parts.append(part.decode("ascii", "replace"))
            match word:
                case b"$timescale":
                    self._unit_ps = self._timescale("".join(parts))
                case b"$comment" if found := _RATE.search(" ".join(parts)):
                    self._sample_ps = rate_period_ps(found.group(1))
                case b"$scope":
                    scopes.append(parts[-1] if parts else "")
                case b"$upscope" if scopes:
                    scopes.pop()
                case b"$var":
                    self._declare(parts, scopes)
        next(words)  # $end
        if self._unit_ps is None:
            raise CaptureError(f"{self._path} has no $timescale, so its times have no unit")
        if not self._channels:
            raise CaptureError(f"{self._path} declares no variables")

    def _timescale(self, text: str) -> float:
        number = text.rstrip("smunpf")
        unit = _UNITS_PS.get(text[len(number) :])
        if number not in ("1", "10", "100") or unit is None:
            raise CaptureError(f"{self._path} has the timescale {text!r:.80}; an example is 1ns")
        return int(number) * unit

    def _declare(self, parts: list[str], scopes: list[str]) -> None:
        if len(parts) < 4 or not parts[1].isdecimal() or not 1 <= int(parts[1]) < 1 << 20:
            text = f"$var {' '.join(parts)}"
            raise CaptureError(f"{self._path} has {text!r:.80}; an example is $var wire 1 ! ACK")
        kind, width, code, *name = parts
        self._numbers.setdefault(code.encode(), ())
        if kind in _NO_LEVEL:
            return
        self._numbers[code.encode()] += (len(self._channels),)
        short = "".join(name)
        self._channels.append(Channel(short, int(width), ".".join([*scopes, short])))

    def _time(self, word: bytes) -> int:
        try:
            time = int(word[1:])
            if abs(time) * max(1.0, self._unit_ps or 0.0) > LATEST_PS:
                raise ValueError
            return time
        except (ValueError, OverflowError):
            raise CaptureError(f"{self._path} is damaged: {_shown(word)} is no time") from None

    def _level(self, word: bytes, now: int) -> int:
        digits = word[1:]
        if digits.strip(b"01"):
            if not digits.strip(b"01xXzZ"):
                return UNKNOWN
            raise self._damaged(now, word, "no binary number")
        return int(digits or b"0", 2) if len(digits) <= WIDEST else UNKNOWN

    def _known(self, code: bytes, now: int) -> tuple[int, ...]:
        if code not in self._numbers:
            raise self._damaged(now, code, "no declared variable")
        return self._numbers[code]

    def _damaged(self, now: int, word: bytes, what: str) -> CaptureError:
        ns = now * (self._unit_ps or 0.0) / 1000
        return CaptureError(f"{self._path} is damaged at {ns:.10g} ns: {_shown(word)}: {what}")


def _shown(word: bytes) -> str:
    text = word[:20].decode("ascii", "replace")
    return repr(text if len(word) <= 20 else f"{text}...")
