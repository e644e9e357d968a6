"""Measure CubeSense's nadir sensor in front of a test ball (thesis, section 7.1).

A rotary stage turns the sensor in front of a lit ball as large as the Earth from
750 km. The mean of several images minus the stage's angle is the offset of figure
7.1; their standard deviation is the sigma of figure 7.2.

examples:
  cubestack ball                                  every 5 deg to 30, 10 pictures each
  cubestack ball --step 1 --samples 100           as published; takes long
  cubestack ball --profile extended --off-axis 1  optic point 1 mm before the axis
  cubestack ball --first 40 --last 60             a part of the ball is out of the field
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import ball_scene
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.firmware_model.values import number, whole
from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.experiments.cubesense.measure import FRAME_S, CubeSenseOpener
from cubestack.host.options import Options

DIRECTIONS = {"right": (1, 0), "left": (-1, 0), "down": (0, 1), "up": (0, -1)}
"""Directions of the ball in the image; figure 7.1 does not name its four parts."""

REACH_DEG = 30.0
"""The ball's edge reaches that of the field there (section 7.1)."""

WIDEST_DEG = 90.0
"""Largest angle of the stage."""

PUBLISHED = "offset 0.12, 0.16, 0.13, 0.15 deg in the four directions; sigma below 0.18 deg"
"""Figures 7.1 and 7.2, shown beside ours; the drawn lenses are fitted to the first."""


@dataclass(frozen=True, kw_only=True)
class BallOptions(Options):
    """Options of `cubestack ball`."""

    first: float = number(0.0, "first angle of the stage (default 0)", 0, WIDEST_DEG, "deg")
    last: float = number(REACH_DEG, f"last one (default {REACH_DEG:g})", 0, WIDEST_DEG, "deg")
    step: float = number(5.0, "of the stage (default 5)", 0.5, 30, "deg")
    samples: int = whole(10, "pictures at each angle (default 10)", 2, metavar="N")
    off_axis: float = number(
        0.0, "distance of the optic point in front of the stage's axis (default 0)", -30, 30, "mm"
    )
    seed: int = whole(0, "seed of everything random (default 0)", 0)

    @property
    def angles(self) -> list[float]:
        return [float(angle) for angle in np.arange(self.first, self.last + 1e-9, self.step)]

    def check(self) -> None:
        if self.last < self.first:
            raise ValueError(f"--last must be at least --first, not {self.last:g} < {self.first:g}")


@dataclass(frozen=True)
class BallResult(Result):
    """One direction; angles in degrees. Attributes are those of the JSON output."""

    direction: str  #: of the ball's motion in the image
    #: detected, pictures: number of detections, and of images
    detected: int
    pictures: int
    offset_deg: float | None  #: mean size of the offsets of the angle along the direction
    worst_deg: float | None  #: the largest of them
    sigma_deg: float | None  #: largest standard deviation at one angle


class _Ball(Experiment[CubeSenseOpener, BallOptions, BallResult]):
    options = BallOptions
    description = __doc__
    title = "nadir sensor in front of the ball: offset from the stage's angle"
    columns = ("direction", "offset", "worst", "sigma", "detected")

    def count(self, options: BallOptions) -> int:
        return len(DIRECTIONS)

    def run(self, opened: CubeSenseOpener, options: BallOptions) -> Iterator[BallResult]:
        rng, offset_mm = np.random.default_rng(options.seed), (0.0, 0.0, options.off_axis)
        with opened(ball_scene(), seed=options.seed) as emulated:
            for name, axis in DIRECTIONS.items():
                means, sigmas, detected = [], [], 0
                for angle in options.angles:
                    scene = ball_scene((axis[0] * angle, axis[1] * angle), offset_mm=offset_mm)
                    found = []
                    for _ in range(options.samples):
                        condition = FisheyeCondition(seed=int(rng.integers(1 << 31)))
                        emulated.scene = EarthSunView(scene, condition)
                        emulated.client.client.pause(float(rng.uniform(0, FRAME_S)))
                        measured = emulated.client.capture_and_detect(Camera.NADIR)
                        if measured.detected:
                            along = axis[0] * measured.alpha_deg + axis[1] * measured.beta_deg
                            found.append(along - angle)
                    detected += len(found)
                    if found:
                        means.append(abs(float(np.mean(found))))
                        sigmas.append(float(np.std(found)))
                yield BallResult(
                    name,
                    detected,
                    options.samples * len(options.angles),
                    float(np.mean(means)) if means else None,
                    max(means, default=None),
                    max(sigmas, default=None),
                )

    def row(self, number: int, result: BallResult) -> tuple[str, ...]:
        angles = (result.offset_deg, result.worst_deg, result.sigma_deg)
        shown = ("-" if angle is None else f"{angle:.3f}" for angle in angles)
        return (result.direction, *shown, f"{result.detected} of {result.pictures}")

    def summarise(self, results: Sequence[BallResult], wall_s: float) -> Iterable[str]:
        yield f"published: {PUBLISHED}"


EXPERIMENT = _Ball()
