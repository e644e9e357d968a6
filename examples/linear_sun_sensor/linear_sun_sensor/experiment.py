"""Measure angles of the Sun with SunSlit end to end, each beside the truth.

Without --scene the Sun is anywhere within --reach of the boresight.

examples:
  cubestack measure sunslit --frames 20
  cubestack measure sunslit --scene scene.toml --json
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.experiments.facts import fact_lines
from cubestack.host.experiments.opener import MeasureOptions, Opener
from cubestack.host.options import between, option
from linear_sun_sensor.client import SunSlit
from linear_sun_sensor.scene import SlitScene

if TYPE_CHECKING:
    from linear_sun_sensor.board import SunSlitBoard


@dataclass(frozen=True, kw_only=True)
class SunOptions(MeasureOptions):
    """Options of `cubestack measure sunslit`."""

    reach: float = option(
        40.0, "largest angle (40)", between(0, 90, "an angle in 0..90 degrees"), metavar="DEG"
    )


@dataclass(frozen=True)
class SunResult(Result):
    """Attributes are those of the JSON output; angles in degrees, None without the Sun."""

    angle_deg: float | None
    truth_deg: float
    error_deg: float | None
    peak: int
    outcome: str
    duration_ms: float


class _Experiment(Experiment["Opener[SunSlitBoard, SunSlit]", SunOptions, SunResult]):
    options = SunOptions
    description = __doc__ or ""
    title = "angle of the Sun over the serial line, beside the truth; degrees"
    columns = ("angle", "truth", "error", "peak", "ms", "outcome")

    def count(self, options: SunOptions) -> int:
        return options.frames

    def run(
        self, opened: Opener[SunSlitBoard, SunSlit], options: SunOptions
    ) -> Iterator[SunResult]:
        given = None if options.scene is None else opened.device.scene(options.scene)
        rng = np.random.default_rng(options.seed)
        with opened(given, seed=options.seed, faults=options.faults) as emulated:
            for _ in range(options.frames):
                angle = float(rng.uniform(-options.reach, options.reach))
                emulated.scene = scene = given or SlitScene(angle, seed=options.seed)
                found = emulated.client.measure()
                error = None if found.angle_deg is None else found.angle_deg - scene.sun_deg
                outcome = found.outcome.name.lower()
                yield SunResult(
                    found.angle_deg, scene.sun_deg, error, found.peak, outcome, found.duration_ms
                )

    def row(self, number: int, result: SunResult) -> tuple[str, ...]:
        angles = (result.angle_deg, result.truth_deg, result.error_deg)
        shown = ("-" if angle is None else f"{angle:.3f}" for angle in angles)
        return (*shown, str(result.peak), f"{result.duration_ms:.2f}", result.outcome)

    def summarise(self, results: Sequence[SunResult], wall_s: float) -> Iterable[str]:
        errors = [abs(result.error_deg) for result in results if result.error_deg is not None]
        worst = f"{max(errors, default=0):.3f} deg"
        return fact_lines({"results": len(results), "found": len(errors), "worst": worst})


EXPERIMENT: Experiment[Any, Any, Any] = _Experiment()
