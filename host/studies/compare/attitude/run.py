"""Every method on every trial: errors about the axes, refusals, operations and time of the part."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.attitude.arithmetic import Matrix
from cubestack.host.studies.compare.attitude.methods import Solve, methods
from cubestack.host.studies.compare.attitude.smoothing import smooth
from cubestack.host.studies.compare.attitude.trials import CASES, STEP_S, Trial, take_trial
from cubestack.host.studies.compare.study import Row
from cubestack.host.studies.compare.tracker import Tracker

FAR_DEG = 1.0
"""An attitude that is off by more, across or about the boresight, is far; errors are of the
others."""

SMOOTHING = "Kalman filter"

Estimate = Callable[[Trial, Meter], Matrix | None]


def estimates() -> dict[str, Estimate]:
    """All methods by name; the filter takes all images, the others the last."""
    found = {method.name: _of_last(method.solve) for method in methods()}
    return found | {
        SMOOTHING: lambda trial, meter: smooth(
            trial.frames, trial.listed, trial.sigma_rad, STEP_S, meter
        )
    }


def _of_last(solve: Solve) -> Estimate:
    return lambda trial, meter: solve(trial.frames[-1], trial.listed, meter)


def errors_deg(found: Matrix, truth: NDArray[np.float64]) -> tuple[float, float]:
    """Errors across and about the boresight, as `cubestack measure` defines them; rows need not
    have length 1."""
    rows = found.astype(np.float64)
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    turn = rows @ truth.T
    cross = 2 * np.arcsin(min(1.0, float(np.linalg.norm(rows[2] - truth[2])) / 2))
    roll = np.arctan2(turn[0, 1] - turn[1, 0], turn[0, 0] + turn[1, 1])
    return float(np.degrees(cross)), float(np.degrees(abs(roll)))


def run(tracker: Tracker, skies: int, seed: int) -> Iterator[Row]:
    """Rows case by case: root mean squares of the errors in arcsec, refused and far attitudes in
    percent, largest deviation from a rotation, and operations and time of an image."""
    methods = estimates()
    for case in CASES:
        taken = (take_trial(tracker, case, seed, number) for number in range(skies))
        trials = [trial for trial in taken if trial is not None]
        for name, estimate in methods.items():
            yield Row(tracker.name, name, case.name, _figures(tracker, trials, name, estimate))


def _figures(
    tracker: Tracker, trials: list[Trial], name: str, estimate: Estimate
) -> Mapping[str, float]:
    errors, refused, defects = list[tuple[float, float]](), 0, [0.0]
    operations, times_ms = list[float](), list[float]()
    for trial in trials:
        meter = Meter(tracker.table)
        found = estimate(trial, meter)
        images = len(trial.frames) if name == SMOOTHING else 1
        operations.append(sum(meter.counts.values()) / images)
        times_ms.append(1000 * tracker.table.seconds(meter.total) / images)
        if found is None or not np.isfinite(found).all():
            refused += 1
            continue
        errors.append(errors_deg(found, trial.truth))
        defects.append(float(np.abs(found @ found.T - np.eye(3)).max()))
    near = np.array([one for one in errors if max(one) <= FAR_DEG]).reshape(-1, 2)
    cross, roll = 3600 * np.sqrt((near**2).mean(axis=0)) if len(near) else (np.nan, np.nan)
    count = max(len(trials), 1)
    return {
        "cross_arcsec": float(cross),
        "roll_arcsec": float(roll),
        "refused": 100 * refused / count,
        "far": 100 * (len(errors) - len(near)) / count,
        "defect": max(defects),
        "operations": float(np.mean(operations)),
        "mean_ms": float(np.mean(times_ms)),
        "longest_ms": max(times_ms),
    }
