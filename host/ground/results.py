"""The log of a target's results."""

import csv
import json
import math
import os
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from io import StringIO
from tempfile import mkstemp

from cubestack.host.clients.contract import Columns
from cubestack.host.devices.result_table import ANGLE
from cubestack.host.export.parquet import parquet_file

MOST = 1_000_000
"""Most lines: eleven days at one line per second."""

ALPHA, BETA = "_alpha_deg", "_beta_deg"
"""Ends of the column names of a direction's angles, along x and y of the image."""

Vector = tuple[float, float, float]


class ResultLog:
    """A log in an unlinked temporary file.

    Attributes:
        count: number of lines.
    """

    def __init__(self) -> None:
        self._file, path = mkstemp(prefix="cubestack-")
        os.unlink(path)
        self.count = 0

    def add(self, results: Columns, truth: Mapping[str, float | None]) -> None:
        """Log results with the current time, and errors of angles if ``truth`` has them."""
        if "error" in results or not results or self.count >= MOST:
            return
        utc = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = {"utc": utc, **results, **_errors(results, truth)}
        os.write(self._file, json.dumps(line).encode() + b"\n")
        self.count += 1

    def csv(self) -> bytes:
        """A CSV file with a column for each name that occurs."""
        text, names = StringIO(newline=""), self._names()
        writer = csv.DictWriter(text, names)
        writer.writeheader()
        writer.writerows(self._lines())
        return text.getvalue().encode()

    def parquet(self) -> bytes:
        """A Parquet file with the same columns; raises ValueError without pyarrow."""
        columns: dict[str, list[bool | int | float | str | None]] = {n: [] for n in self._names()}
        for line in self._lines():
            for name, column in columns.items():
                column.append(line.get(name))
        return parquet_file(columns)

    def close(self) -> None:
        os.close(self._file)

    def _names(self) -> list[str]:
        return list(dict.fromkeys(name for line in self._lines() for name in line)) or ["utc"]

    def _lines(self) -> Iterator[Columns]:
        rest, at, end = b"", 0, os.fstat(self._file).st_size
        while at < end:
            part = os.pread(self._file, min(1 << 20, end - at), at)
            at += len(part)
            *lines, rest = (rest + part).split(b"\n")
            yield from map(json.loads, lines)


def _errors(results: Columns, truth: Mapping[str, float | None]) -> Columns:
    errors: Columns = {}
    for name, value in results.items():
        true = truth.get(name) if name.endswith(ANGLE) else None
        if true is not None and isinstance(value, int | float):
            errors[f"{name.removesuffix(ANGLE)}_error{ANGLE}"] = (value - true + 180) % 360 - 180
    for name in (one.removesuffix(ALPHA) for one in results if one.endswith(ALPHA)):
        answer, true_ = (_direction(columns, name) for columns in (results, truth))
        if answer is not None and true_ is not None:
            errors[f"{name}_error{ANGLE}"] = _apart_deg(answer, true_)
    return errors


def _direction(columns: Mapping[str, object], name: str) -> Vector | None:
    """Unit vector of a direction; None if an angle is missing."""
    alpha, beta = columns.get(name + ALPHA), columns.get(name + BETA)
    if not isinstance(alpha, int | float) or not isinstance(beta, int | float):
        return None
    away, around = math.radians(math.hypot(alpha, beta)), math.atan2(beta, alpha)
    across = math.sin(away)
    return across * math.cos(around), across * math.sin(around), math.cos(away)


def _apart_deg(one: Vector, other: Vector) -> float:
    return math.degrees(2 * math.asin(min(math.dist(one, other) / 2, 1.0)))


FORMS: dict[str, Callable[[ResultLog], bytes]] = {
    "csv": ResultLog.csv,
    "parquet": ResultLog.parquet,
}
"""By file suffix."""
