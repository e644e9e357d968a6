"""The subject of upsets: a device's loop and its verdict."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.wiring import Wiring

Answer = Literal["right", "refused", "wrong"]

IDLE = "idle"
"""State of idle FPGAs."""

STORING = "storing"
"""State of storing FPGAs; between two images it is the phase `BETWEEN`."""

BETWEEN = "between"


@dataclass(frozen=True)
class UpsetVerdict:
    """What the device answered after a loop, beside the truth; ``reason`` of a refusal."""

    answer: Answer
    reason: str = ""


@dataclass(frozen=True)
class Subject:
    """How one device is put to work.

    Attributes:
        scene: something that it should measure rightly.
        start: has a powered-up one begin a loop, and returns at once.
        judge: waits for the answer of its loop, and judges it.
        state: what the FPGAs are commanded: `IDLE`, `STORING`, or another name.
        row_bytes: of a line of the picture.
        period_s: from one loop to the next, in use.
        ready: waits until a device that was just powered up takes commands.
    """

    scene: Callable[[np.random.Generator], Any]
    start: Callable[[Any], None]
    judge: Callable[[Any], UpsetVerdict]
    state: Callable[[RtlEngine], str]
    row_bytes: int
    period_s: float = 1.0
    ready: Callable[[Any], None] = lambda _emulated: None


@dataclass(frozen=True)
class Rig:
    """Whose bits are turned over, and in what work.

    Attributes:
        subjects: how it is put to work; one of them by chance.
        wiring: of its FPGAs, for the names of their registers; the same object for the same ones.
        phases: of a loop, those that there always are.
        memories: of the board, by name, that are hit unless others are asked for.
        board: keywords that choose it.
    """

    subjects: tuple[Subject, ...]
    wiring: Callable[[], Wiring]
    phases: tuple[str, ...]
    memories: tuple[str, ...]
    board: Mapping[str, Any] = field(default_factory=dict)
