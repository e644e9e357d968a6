"""One measurement: picture, catalogue, stars, identities, attitude, and the time of each step.

AraMiS thesis, sections 2.2 (getStarAttitudeQuaternion) and 7.3; figure 8.1. Only this module calls
the processing, :mod:`cubestack.firmware_model.aramis.pipeline`.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeVar

from cubestack.firmware_model.aramis import pipeline
from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.aramis.camera import Camera
from cubestack.firmware_model.aramis.catalogue.flash_store import CatalogueStore
from cubestack.firmware_model.aramis.detection.mask import LevelHistory, SpikeRemoval
from cubestack.firmware_model.aramis.field import FOV_DEG, CameraField
from cubestack.firmware_model.aramis.settings import StoredSettings
from cubestack.firmware_model.aramis.state import MeasurementResult, State
from cubestack.firmware_model.attitude.quest import dcm
from cubestack.firmware_model.interface import aramis
from cubestack.firmware_model.interface.aramis import MeasurementMode, Reason, SensorState
from cubestack.firmware_model.interface.aramis.switches import DEFAULT_SWITCHES, AramisSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Routine

T = TypeVar("T")

#: With a local threshold, number of candidates per MaxStars: half of them may be no stars.
HALF_FALSE = 2


@lru_cache(maxsize=4)
def _lens(fov_deg: float, only_round: bool) -> CameraField:
    """The lens; kept, because it holds the mask of its pixels."""
    return CameraField(fov_deg=fov_deg, round=only_round)


def configuration(
    settings: StoredSettings, switches: AramisSwitches = DEFAULT_SWITCHES
) -> pipeline.Configuration:
    """Settings of the processing; what a switch has as printed, no setting changes."""
    search, matching = settings.all("SetDetection"), settings.all("SetIdentification")
    field = settings.all("SetField")
    lens = _lens(float(field["FieldOfView"]), bool(field["Round"]))
    local = switches.detection == "local"
    detection = pipeline.DetectionSettings(
        sigmas=float(search["Sigmas"]),
        spikes=SpikeRemoval(search["Spikes"]),
        needed=int(search["Needed"]),
        min_pixels=int(search["MinPixels"]),
        max_pixels=int(search["MaxPixels"]),
        max_stars=int(search["MaxStars"]) * (HALF_FALSE if local else 1),
        local=local,
        subtract=bool(search["Subtract"]) and switches.weights == "above-mean",
    )
    sigma_rad = float(matching["Noise"]) * lens.scale[1]
    if switches.noise == "appendix-e":
        sigma_rad = pipeline.PUBLISHED.profile.sigma_rad * lens.fov_deg / FOV_DEG
    profile = replace(
        pipeline.VERIFIED.profile,
        sigma_rad=sigma_rad,
        pivots=int(matching["Pivots"]),
        always_pivot=switches.pivots == "always",
        filtered=switches.aided == "filtered",
        identities=switches.identities,
        by_variance=switches.scores == "variance",
        verify=bool(matching["Verify"]) and switches.belief == "confirmed",
        hint_tolerance_deg=float(matching["HintTolerance"]),
    )
    return pipeline.Configuration(lens, detection, profile)


@dataclass
class Measuring:
    """Measures, and keeps the state between measurements."""

    _meter: Meter
    _state: State
    _camera: Camera
    _catalogue: CatalogueStore

    def __post_init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        self._background = LevelHistory()

    def latest_boresight(self) -> Floats | None:
        """Inertial unit vector (3,) of the latest measurement's boresight; None without one."""
        if self._state.quaternion is None or not self._state.measurement.valid:
            return None
        boresight: Floats = dcm(self._state.quaternion, self._meter)[2]
        return boresight

    def measure(self, hint: Floats | None, *, overlap: bool = False) -> Routine[None]:
        """Measure once, into ``State.measurement``; ``hint`` as for ``identify``.

        With ``overlap``, the next frame comes while this one is worked on.
        """
        mode = MeasurementMode.LOST_IN_SPACE if hint is None else MeasurementMode.AIDED
        result = MeasurementResult(mode=mode)
        steps = self._steps(result, hint, overlap=overlap)
        failure = yield from self._timed(result, "Total", steps)
        if failure is not None:
            result.outcome, result.reason = aramis.MeasurementOutcome.NONE, failure
        self._state.star = 0
        self._state.measurement = result

    def _timed(self, result: MeasurementResult, step: str, routine: Routine[T]) -> Routine[T]:
        started_us: int = yield ReadTimer()
        outcome = yield from routine
        yield Pay()
        now_us: int = yield ReadTimer()
        result.times_us[step] = now_us - started_us
        return outcome

    def _steps(
        self, result: MeasurementResult, hint: Floats | None, *, overlap: bool
    ) -> Routine[Reason | None]:
        if not self._state.active:
            self._state.raise_flag("NotActive")
            return Reason.NOT_ACTIVE
        self._state.sensor = SensorState.MEASURING
        failure = yield from self._picture(result, overlap=overlap)
        if failure is None:
            failure = yield from self._check(result)
        if failure is None:
            yield from self._process(result, hint)
        self._state.sensor = SensorState.READY
        return failure

    def _picture(self, result: MeasurementResult, *, overlap: bool) -> Routine[Reason | None]:
        failure = yield from self._timed(result, "Setup", self._camera.start())
        if failure is None:
            failure = yield from self._timed(result, "Capture", self._camera.take())
        if failure is not None:
            return failure
        result.image_us = self._camera.image_us()
        result.frame = self._state.frames
        if overlap:
            self._camera.expose()
        return None

    def _check(self, result: MeasurementResult) -> Routine[Reason | None]:
        errors = self._catalogue.ram_errors
        good = yield from self._timed(result, "Check", self._catalogue.ensure())
        if self._catalogue.ram_errors != errors:
            self._state.raise_flag("RamError")
        if good:
            return None
        missing = self._catalogue.state is aramis.CatalogueState.MISSING
        return Reason.NO_CATALOGUE if missing else Reason.CATALOGUE_DAMAGED

    def _process(self, result: MeasurementResult, hint: Floats | None) -> Routine[None]:
        database, place = self._catalogue.database, self._camera.latest
        assert database is not None
        assert place is not None
        with self._phases(result):
            settings = configuration(self._state.settings, self._state.switches.now)
            exposure = int(self._state.settings.get("SetExposure", "Rows"))
            picture, past = self._camera.picture(place), self._background
            solution = pipeline.solve(
                picture, past, settings, database, self._meter, hint, exposure
            )
            light = solution.measured.light
            if light is None:
                result.mean = past.mean(self._meter)
                result.threshold = past.threshold(settings.detection.sigmas, self._meter)
                result.pictures = len(past.sums)
            else:
                result.mean, result.threshold = round(light.background), round(light.threshold)
                result.pictures = 1
        yield Pay()
        result.solution, result.outcome = solution, solution.outcome
        result.reason = solution.reason
        if solution.quaternion is not None:
            self._state.quaternion = solution.quaternion
            self._state.matched = int((solution.stars >= 0).sum())

    @contextmanager
    def _phases(self, result: MeasurementResult) -> Iterator[None]:
        """Record the cycles of each phase that the block charges."""
        before = dict(self._meter.phases)
        yield
        for name in aramis.PHASES:
            spent = self._meter.phases.get(name.lower(), 0) - before.get(name.lower(), 0)
            if spent:
                result.times_us[name] = 1_000_000 * spent // self._meter.table.clock_hz
