"""What a device's program costs as compiled code, and how that is measured."""

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
    """How the costs of a device's program are measured.

    Attributes:
        levels, precisions: which builds there are.
        measure: measures those of some levels and precisions, one after the other.
        as_data: what goes into ``file``.
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
