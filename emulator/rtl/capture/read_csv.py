"""Reads CSV files of logic analysers: one column per channel, one line per sample.

sigrok-cli -O csv (libsigrok's output/csv.c): comment lines from ";" on, with the names of the
channels and the sampling rate; a line of labels, which are names or "logic"; a column of times in
whole units, for which the period is rounded down. If the rate is known, samples are counted
instead.
Other programs name the unit of the times in the label: "Time [s]".
"""

import re
from collections.abc import Iterable, Iterator
from io import TextIOWrapper
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.capture.capture import (
    LATEST_PS,
    Capture,
    CaptureError,
    Channel,
    rate_period_ps,
)
from cubestack.firmware_model.formats.untrusted import LARGEST_FILE, opened

_UNITS_PS = {
    unit: 10.0**power
    for power, units in (
        (12, ("s", "seconds")),
        (9, ("ms", "milliseconds")),
        (6, ("us", "microseconds")),
        (3, ("ns", "nanoseconds")),
        (0, ("ps", "picoseconds")),
        (-3, ("fs", "femtoseconds")),
    )
    for unit in units
}

_CHANNELS = re.compile(r"Channels \(\d+/\d+\):(.*)")

_TIMES = re.compile(rf"time(?:\s*[\[(]?({'|'.join(_UNITS_PS)})[\])]?)?$|({'|'.join(_UNITS_PS)})$")

_REMARKS = (";", "#")

_HEAD_LINES = 1000


def read_csv(path: Path) -> Capture:
    """Raises CaptureError for a file that is none or is damaged."""
    with opened(path, LARGEST_FILE, CaptureError) as file:
        stream = TextIOWrapper(file, "latin-1")
        names: list[str] = []
        period_ps: float | None = None
        labels: list[str] | None = None
        lines: Iterator[str] = stream
        for line in islice(stream, _HEAD_LINES):
            text = line.strip()
            if text.startswith(_REMARKS):
                remark = text[1:].strip()
                if found := _CHANNELS.match(remark):
                    names = [name.strip() for name in found[1].split(",")]
                elif remark.lower().startswith("samplerate:"):
                    period_ps = rate_period_ps(remark.partition(":")[2])
            elif text:
                cells = [cell.strip().strip('"') for cell in text.split(",")]
                if all(_is_number(cell) for cell in cells):
                    lines = chain([line], stream)
                else:
                    labels = cells
                break
        samples = _samples(path, lines)
    return _capture(path, labels, names, period_ps, samples)


def _samples(path: Path, stream: Iterable[str]) -> NDArray[np.float64]:
    """The numbers of all lines, shape (samples, columns)."""
    lines = (line for line in stream if line.strip() and not line.startswith(_REMARKS))
    first = next(lines, None)
    if first is None:
        raise CaptureError(f"{path} has no samples")
    try:
        return np.loadtxt(chain([first], lines), delimiter=",", ndmin=2, comments=None)
    except ValueError as error:
        reason = str(error).split(";")[0].rstrip(".")
        raise CaptureError(f"{path} is damaged: {reason}; rows are samples") from None


def _capture(
    path: Path,
    labels: list[str] | None,
    names: list[str],
    period_ps: float | None,
    samples: NDArray[np.float64],
) -> Capture:
    columns = samples.shape[1]
    named = labels is not None and not set(labels[1:]) <= {"logic"}
    if labels is not None and len(labels) != columns:
        raise CaptureError(f"{path} has {len(labels)} labels, but {columns} columns")
    # Without labels, one column more than the names is the time.
    timed = _TIMES.match(labels[0].lower()) if labels else columns == len(names) + 1
    if labels is not None and named:
        names = labels[1:] if timed else labels
    elif len(names) != columns - bool(timed):
        raise CaptureError(
            f"{path} names {len(names)} channels for {columns - bool(timed)} columns; the line"
            " before the samples can name them: Time [ns],ENABLE,ACK"
        )
    if timed:
        times, period_ps = _times(path, labels[0] if labels else "", period_ps, samples[:, 0])
        samples = samples[:, 1:]
    elif period_ps is None:
        raise CaptureError(
            f"{path} has neither times nor a sampling rate; a line '; Samplerate: 24 MHz' gives it"
        )
    else:
        times = np.round(np.arange(len(samples)) * period_ps).astype(np.int64)
    if names and names[-1].lower() == "trigger":
        names, samples = names[:-1], samples[:, :-1]
    wrong = np.argwhere((samples != 0) & (samples != 1))
    if len(wrong):
        row, column = wrong[0]
        raise CaptureError(
            f"{path} has {samples[row, column]:g} for {names[column]} in sample {row + 1};"
            " a level is 0 or 1"
        )
    levels = samples.astype(np.int8)
    changed = np.ones(levels.shape, bool)
    changed[1:] = levels[1:] != levels[:-1]
    rows, numbers = np.nonzero(changed)
    channels = tuple(Channel(name) for name in names)
    values = levels[rows, numbers].astype(np.int64)
    return Capture(
        channels, times[rows], numbers.astype(np.int32), values, int(times[-1]), period_ps
    )


def _times(
    path: Path, label: str, period_ps: float | None, column: NDArray[np.float64]
) -> tuple[NDArray[np.int64], float | None]:
    """Times in ps from the first sample on, and the sampling period."""
    if not np.isfinite(column).all() or (np.diff(column) < 0).any():
        raise CaptureError(f"{path} is damaged: its times do not increase")
    found = _TIMES.match(label.lower())
    unit = _UNITS_PS.get((found.group(1) or found.group(2) or "") if found else "")
    steps = column - column[0]
    if period_ps is not None:
        # The column counts in whole units, so a step may be shorter than the period.
        step = np.diff(column)[np.diff(column) > 0].min(initial=np.inf)
        if np.isfinite(step) and (unit is None or abs(step * unit - period_ps) < unit):
            steps, unit = np.round(steps / step), period_ps
    if unit is None:
        raise CaptureError(
            f"{path} gives no unit of its times; label the column 'Time [ns]', or add a line"
            " '; Samplerate: 24 MHz'"
        )
    with np.errstate(over="ignore"):
        times = np.round(steps * unit)
    if times.max(initial=0.0) > LATEST_PS:
        raise CaptureError(f"{path} is damaged: its times end after {LATEST_PS} ps")
    return times.astype(np.int64), period_ps


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
