"""Measure angles of the Sun with SunSlit end to end, each beside the truth.

Without --scene the Sun is anywhere within --reach of the boresight.

examples:
  cubestack measure sunslit --frames 20
  cubestack measure sunslit --scene scene.toml --json
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cubestack.sensor import MeasureOptions, SceneExperiment, number
from linear_sun_sensor.scene import SlitScene


@dataclass(frozen=True, kw_only=True)
class SunOptions(MeasureOptions):
    """Options of `cubestack measure sunslit`."""

    reach: float = number(40.0, "largest angle (40)", 0, 90, "deg")


def random_scene(rng: np.random.Generator, options: SunOptions) -> SlitScene:
    return SlitScene(float(rng.uniform(-options.reach, options.reach)), seed=options.seed)


def measure(emulated: Any) -> tuple[Any, ...]:
    found, truth_deg = emulated.client.measure(), emulated.scene.sun_deg
    error_deg = None if found.angle_deg is None else found.angle_deg - truth_deg
    outcome = found.outcome.name.lower()
    return found.angle_deg, truth_deg, error_deg, found.peak, found.duration_ms, outcome


EXPERIMENT = SceneExperiment(
    __doc__,
    random_scene,
    measure,
    ("angle_deg", "truth_deg", "error_deg", "peak", "duration_ms", "outcome"),
    title="angle of the Sun over the serial line, beside the truth",
    options=SunOptions,
)
