"""The fixed threshold against the dynamic one (thesis, section 4.1.1): errors, and time."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cubestack.emulator.camera.ov7620.view import FisheyeCondition
from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.host.experiments.cubesense.measure import (
    FRAME_S,
    CubeSenseOpener,
    measure_once,
    view_of,
)
from cubestack.host.studies.rows.estimate import average, rate_of
from cubestack.host.studies.rows.trial import Figures

#: Sensor and angle of its target from the boresight, in a random direction.
POSES: Mapping[str, tuple[Camera, float]] = {
    "whole": (Camera.NADIR, 10.0),
    "partial": (Camera.NADIR, 45.0),
    "sun": (Camera.SUN, 10.0),
}


def thresholds(opened: CubeSenseOpener, frames: int) -> Figures:
    """Mean error and share of detections by pose and threshold; time that ``dynamic`` adds."""
    figures: dict[str, float] = {}
    spent: dict[str, list[float]] = {}
    for kind in ("fixed", "dynamic"):
        chosen = replace(opened, board={**opened.board, "set": f"threshold={kind}"})
        rng = np.random.default_rng(2)  # the same poses for both
        for name, (sensor, angle) in POSES.items():
            errors = []
            with chosen(_view(sensor, angle, rng), seed=2) as emulated:
                for _ in range(frames):
                    emulated.scene = _view(sensor, angle, rng)
                    emulated.client.client.pause(float(rng.uniform(0, FRAME_S)))
                    began_s = emulated.time_s
                    result = measure_once(emulated, sensor, Sram(sensor))
                    spent.setdefault(kind, []).append(emulated.time_s - began_s)
                    if result.error_deg is not None:
                        errors.append(result.error_deg)
            figures[f"{name}_{kind}"] = average(errors)
            figures[f"{name}_{kind}_found"] = rate_of(len(errors), frames)
    return figures | {"more_s": float(np.mean(spent["dynamic"]) - np.mean(spent["fixed"]))}


def _view(sensor: Camera, angle_deg: float, rng: np.random.Generator) -> object:
    turn = rng.uniform(0, 2 * np.pi)
    angles = float(angle_deg * np.cos(turn)), float(angle_deg * np.sin(turn))
    return view_of(sensor, angles, FisheyeCondition(seed=int(rng.integers(1 << 31))))
