"""Measures a block of frames, in any process or machine.

A failed frame is a row with its error, and the next one starts with a new seed; so any row can be
measured again from its seed and its position after it.
"""

import gc
from collections.abc import Iterator
from dataclasses import asdict, dataclass, is_dataclass
from typing import Any

import numpy as np

from cubestack.emulator.native.compiler import CompilerError
from cubestack.host.devices.registry import device as registered
from cubestack.host.experiments.measure import experiment_of, measure
from cubestack.host.experiments.rates import outcome, why_refused
from cubestack.host.studies.campaign.plan import FrameBlock, Values

WALL = "wall_ms"
"""The only value of a result that does not repeat."""


@dataclass(frozen=True)
class Row:
    """Outcome of a frame."""

    #: block, row: of the campaign; of the block, from 0
    block: int
    row: int
    seed: int  #: of the first frame since the device was powered up
    after: int  #: results since then
    swept: Values  #: options that differ between blocks
    outcome: str  #: right, refused, wrong, or failed
    reason: str  #: why it was refused, or how it failed
    #: as `cubestack measure --json` has it, without its wall time; none of a failed one
    result: Values

    @property
    def key(self) -> tuple[int, int]:
        return self.block, self.row


def rows_of(block: FrameBlock) -> int:
    """Number of rows: one per camera and frame."""
    experiment = experiment_of(registered(block.device), block.command)
    own = experiment.options.declared()
    options = {name: value for name, value in block.options.items() if name in own}
    return int(experiment.count(experiment.options(frames=block.frames, seed=0, **options)))


def measured(block: FrameBlock, frames: int, seed: int, **more: Any) -> Iterator[Any]:
    """Results from one power-up on; ``more`` are arguments of ``measure``."""
    options = {"frames": frames, "seed": seed, **block.options}
    return measure(block.device, command=block.command, **options, **more)


def frames_of(block: FrameBlock, seed: int) -> int:
    """Number of frames planned for the power-up with that seed."""
    seeds = [block.seed, *(_seed(block.seed, frame) for frame in range(1, block.frames))]
    return block.frames - seeds.index(seed)


def perform(block: FrameBlock) -> list[Row]:
    rows = list[Row]()
    a_frame, frame = rows_of(block) // block.frames, 0
    while frame < block.frames:
        seed = _seed(block.seed, frame) if frame else block.seed
        results = measured(block, block.frames - frame, seed)
        rows += _measured(block, results, len(rows), seed, a_frame)
        frame = len(rows) // a_frame
    gc.collect()  # a device is a cycle of few objects, with megabytes of arrays
    return rows


def _measured(
    block: FrameBlock, results: Iterator[Any], before: int, seed: int, a_frame: int
) -> Iterator[Row]:
    """Rows from one power-up on, up to the first failed frame."""
    after = 0
    try:
        for result in results:
            reason = why_refused(result) if outcome(result) == "refused" else ""
            yield Row(
                *(block.number, before + after, seed, after, block.swept),
                *(outcome(result), reason, _plain(result.as_dict())),
            )
            after += 1
    except CompilerError:
        raise
    except Exception as error:  # any error of one frame among thousands
        text = f"{type(error).__name__}: {error}"
        for other in range(after, after + a_frame - after % a_frame):
            yield Row(block.number, before + other, seed, other, block.swept, "failed", text, {})


def _seed(seed: int, frame: int) -> int:
    """Seed for the frames of a block from one on."""
    return int(np.random.default_rng([seed, frame]).integers(1 << 31))


def _plain(result: dict[str, Any]) -> dict[str, Any]:
    return {name: _value(value) for name, value in result.items() if name != WALL}


def _value(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return list(value) if isinstance(value, tuple) else value
