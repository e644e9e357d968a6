"""Contract of compiled costs: results, and how they are measured."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class CostMeasurement:
    """Of one build."""

    #: build, timing: compiler options and precision, and waits of the memories, in words
    build: str
    timing: str
    operations: Mapping[str, float]  #: cycles of each operation by name
    phases: Mapping[str, int]  #: cycles of each phase of the processing


@dataclass(frozen=True)
class CostReport:
    """The cost measurement of a device's program."""

    #: levels, precisions: available builds
    levels: tuple[str, ...]
    precisions: tuple[str, ...]
    #: measures builds of the given levels and precisions
    measure: Callable[[Sequence[str], Sequence[str]], Iterator[CostMeasurement]]
    as_data: Callable[[Sequence[CostMeasurement]], dict[str, Any]]  #: content of ``file``
    file: Path
    page: Callable[[Sequence[CostMeasurement]], str]  #: a table for ``document``, a page of docs
    document: str
    table: Mapping[str, float]  #: cycles that the device's model charges, by name
