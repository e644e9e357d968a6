"""Trials on the thesis' benches: a ball partly out of the field, and causes of scatter.

CubeSense thesis, sections 5.4, 7.1 and 7.2. The thesis does not say what scatters its angles. Tried
are noise of the pixels, the nadir bench's lamp, and a camera that shakes while its rows are read.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from cubestack.emulator.camera.common.hazards.contract import Field, SensorHazard
from cubestack.emulator.camera.common.hazards.lenses import Wobble
from cubestack.emulator.camera.common.hazards.veils import Background
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import EarthSunScene, ball_scene
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.interface.cameras.ov7620 import CLOCKS_PER_LINE, PIXEL_CLOCK_HZ
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.firmware_model.values import number
from cubestack.host.experiments.cubesense.measure import FRAME_S, CubeSenseOpener, view_of
from cubestack.host.studies.cubesense.ball import EXPERIMENT, BallOptions
from cubestack.host.studies.rows.estimate import average, deviation
from cubestack.host.studies.rows.trial import Figures

PARTIAL_DEG = (30, 45, 60)
"""Angles of the stage from which a part of the ball is out of the field."""


def partial_earth(opened: CubeSenseOpener, frames: int) -> Figures:
    """Mean offset of four directions and their sigma, at each of ``PARTIAL_DEG``; detections."""
    figures: dict[str, float] = {}
    samples = max(2, frames)
    for angle in PARTIAL_DEG:
        options = BallOptions(first=angle, last=angle, samples=samples)
        results = [one for one in EXPERIMENT.run(opened, options) if one.offset_deg is not None]
        figures[f"offset_{angle}"] = average(one.offset_deg or 0.0 for one in results)
        variances = [(one.sigma_deg or 0.0) ** 2 for one in results]
        if not variances:
            figures[f"sigma_{angle}"] = np.nan
            continue
        sigma = float(np.sqrt(np.mean(variances)))
        figures[f"sigma_{angle}"] = deviation(sigma, len(results) * (samples - 1))
    return figures


MAINS_HZ = 50.0


@dataclass(frozen=True, kw_only=True)
class LampSwing(SensorHazard):
    """Light that swings at twice the mains' frequency, seen row by row; the phase is random."""

    meaning: ClassVar[str] = "a lamp whose light swings"
    strength: ClassVar[Strength] = Strength("depth", "", (0, 0.1, 0.3, 0.6))

    depth: float = number(0.6, "of the swing, relative to the mean light", 0, 1)

    def response(self, shape: tuple[int, int]) -> Field | None:
        phase = np.random.default_rng(self.seed).random()
        time_s = np.arange(shape[0]) * CLOCKS_PER_LINE / PIXEL_CLOCK_HZ
        swing = 1 + self.depth * np.sin(2 * np.pi * (2 * MAINS_HZ * time_s + phase))
        return np.repeat(swing[:, None], shape[1], axis=1).astype(np.float32)


Cause = Callable[..., SensorHazard]

CAUSES: Mapping[str, Cause] = {
    "noise": partial(Background, counts=0.0, sigma=10.0),
    "lamp": LampSwing,
    "shake25": partial(Wobble, px=0.25),
    "shake75": partial(Wobble, px=0.75),
}
"""Causes of scatter, of a seed."""

SUN_DEG = (0.0, 40.0)
BALL_DEG = ((0.0, 0.0), (30.0, 0.0), (0.0, 30.0))


def scatter(opened: CubeSenseOpener, frames: int) -> Figures:
    """Largest sigma of some poses and both axes, by cause and sensor."""
    rng, figures = np.random.default_rng(2), dict[str, float]()
    balls = [ball_scene(angles) for angles in BALL_DEG]
    suns = [view_of(Camera.SUN, (angle, 0.0), FisheyeCondition()).scene for angle in SUN_DEG]
    with opened(balls[0], seed=2) as emulated:

        def sigma(
            sensor: Camera, scene: EarthSunScene, cause: Callable[..., SensorHazard]
        ) -> float:
            found = []
            for _ in range(max(2, frames)):
                hazard = cause(seed=int(rng.integers(1 << 31)))
                condition = FisheyeCondition(seed=hazard.seed, hazards=(hazard,))
                emulated.scene = EarthSunView(scene, condition)
                emulated.client.client.pause(float(rng.uniform(0, FRAME_S)))
                measured = emulated.client.capture_and_detect(sensor)
                if measured.detected:
                    found.append((measured.alpha_deg, measured.beta_deg))
            return float(np.std(found, axis=0).max())

        for name, cause in CAUSES.items():
            for sensor, scenes in ((Camera.NADIR, balls), (Camera.SUN, suns)):
                largest = max(sigma(sensor, scene, cause) for scene in scenes)
                key = f"{name}_{sensor.name.lower()}"
                figures[key] = deviation(largest, max(2, frames) - 1)
    return figures
