"""Rates of right, refused and wrong results over the strength of each hazard.

The results come end to end: scene, camera, electronics, firmware, serial line, host. A result is
right as `cubestack measure` judges it; wrong if the sensor calls it valid and it is not right.
"""

from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cubestack.host.devices.device import AnyDevice
from cubestack.host.devices.registry import device as registered
from cubestack.host.devices.registry import devices
from cubestack.host.experiments.hazard_options import Asked, known
from cubestack.host.experiments.measure import experiment_of, measure
from cubestack.host.experiments.rates import outcome, why_refused
from cubestack.host.studies.workers import performed


@dataclass(frozen=True)
class Job:
    """Frames of one device with one hazard: one run of `cubestack measure`."""

    device: str
    profile: str
    hazard: str
    strength: float
    frames: int
    seed: int


@dataclass(frozen=True)
class Point(Job):
    """Result of a job."""

    #: right, refused, wrong: numbers of images
    right: int
    refused: int
    wrong: int
    reasons: Mapping[str, int]  #: the device's reasons of refusals, with their numbers

    @property
    def pictures(self) -> int:
        """Number of images; a frame of several cameras has one per camera."""
        return self.right + self.refused + self.wrong

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def devices_with_hazards() -> list[str]:
    return [
        device.name
        for device in devices()
        if device.experiment is not None and "hazard" in device.experiment().options.declared()
    ]


def hazards_of(device: AnyDevice) -> list[str]:
    """Names of the hazards that its experiment takes, sorted."""
    options: Any = experiment_of(device).options
    found = []
    for name in sorted(known()):
        try:
            options(hazard=(Asked(name),))
        except ValueError:  # not of this device
            continue
        found.append(name)
    return found


def jobs_of(
    device: str, names: Sequence[str], frames: int, seed: int, profile: str
) -> Iterator[Job]:
    """One job per strength and hazard; default: all hazards of the device.

    Raises ValueError for a hazard that the device does not have.
    """
    own = hazards_of(registered(device))
    for name in names:
        if name not in own:
            raise ValueError(f"hazard: {device} has no {name!r}; known: {', '.join(own)}")
    for name in names or own:
        for strength in known()[name].strength.values:
            yield Job(device, profile, name, strength, frames, seed)


def perform(job: Job) -> Point:
    """Run one job, in any process."""
    options: dict[str, Any] = {"frames": job.frames, "seed": job.seed, "profile": job.profile}
    ended: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    for result in measure(job.device, hazard=(Asked(job.hazard, job.strength),), **options):
        ended[outcome(result)] += 1
        if outcome(result) == "refused":
            reasons[why_refused(result)] += 1
    return Point(
        **asdict(job),
        right=ended["right"],
        refused=ended["refused"],
        wrong=ended["wrong"],
        reasons=dict(reasons.most_common()),
    )


def run(jobs: Sequence[Job], workers: int) -> Iterator[Point]:
    """Points of the jobs in their order, each when it and all before it are done."""
    found: dict[Job, Point] = {}
    rest = deque(jobs)
    for job, point in performed(perform, jobs, workers):
        found[job] = point
        while rest and rest[0] in found:
            yield found.pop(rest.popleft())
