"""Contract of compiled costs: results, and how they are measured."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class CostMeasurement:
    """Of one build.

    Attributes:
        build, timing: compiler options and precision, and waits of the memories, in words.
        operations: cycles of each operation by name.
        phases: cycles of each phase of the processing.
    """

    build: str
    timing: str
    operations: Mapping[str, float]
    phases: Mapping[str, int]


@dataclass(frozen=True)
class CostReport:
    """The cost measurement of a device's program.

    Attributes:
        levels, precisions: available builds.
        measure: measures builds of the given levels and precisions.
        as_data: content of ``file``.
        page: a table for ``document``, a page of docs.
        table: cycles that the device's model charges, by name.
    """

    levels: tuple[str, ...]
    precisions: tuple[str, ...]
    measure: Callable[[Sequence[str], Sequence[str]], Iterator[CostMeasurement]]
    as_data: Callable[[Sequence[CostMeasurement]], dict[str, Any]]
    file: Path
    page: Callable[[Sequence[CostMeasurement]], str]
    document: str
    table: Mapping[str, float]
