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
    """How one device is put to work."""

    scene: Callable[[np.random.Generator], Any]  #: something that it should measure rightly
    start: Callable[[Any], None]  #: has a powered-up one begin a loop, and returns at once
    judge: Callable[[Any], UpsetVerdict]  #: waits for the answer of its loop, and judges it
    #: what the FPGAs are commanded: `IDLE`, `STORING`, or another name
    state: Callable[[RtlEngine], str]
    row_bytes: int  #: of a line of the picture
    period_s: float = 1.0  #: from one loop to the next, in use
    #: waits until a device that was just powered up takes commands
    ready: Callable[[Any], None] = lambda _emulated: None


@dataclass(frozen=True)
class Rig:
    """Whose bits are turned over, and in what work."""

    subjects: tuple[Subject, ...]  #: how it is put to work; one of them by chance
    #: of its FPGAs, for the names of their registers; the same object for the same ones
    wiring: Callable[[], Wiring]
    phases: tuple[str, ...]  #: of a loop, those that there always are
    memories: tuple[str, ...]  #: of the board, by name, that are hit by default
    board: Mapping[str, Any] = field(default_factory=dict)  #: keywords that choose it
