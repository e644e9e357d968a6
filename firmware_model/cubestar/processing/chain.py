"""The chain from image to attitude: detection, matching and QUEST, with the time of each step.

CubeStar thesis, sections 5.3.3 to 5.3.5. ``transitions`` decides which search identifies an image.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from cubestack.firmware_model.attitude.geometry import undistort, unit_vectors
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm
from cubestack.firmware_model.cubestar import configuration, phases
from cubestack.firmware_model.cubestar.body_list import PAGE_BYTES, Body
from cubestack.firmware_model.cubestar.capture import ImageCapture
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.detection import SearchEnd
from cubestack.firmware_model.cubestar.detection.disc import find_disc
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.processing import bodies, estimate
from cubestack.firmware_model.cubestar.processing.estimate import Estimate, by_errors, by_votes
from cubestack.firmware_model.cubestar.processing.gyro import measure_rate
from cubestack.firmware_model.cubestar.processing.identify import (
    FEWEST_STARS,
    OUTCOME_FLAGS,
    Results,
    Searches,
)
from cubestack.firmware_model.cubestar.processing.transitions import Automatic, transitions_of
from cubestack.firmware_model.cubestar.state import UNRATED, Attitude, State
from cubestack.firmware_model.interface.cubestar.codes import Disc, Reason, TaskStatus
from cubestack.firmware_model.interface.cubestar.extensions import MOST_BODIES
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine
from cubestack.firmware_model.star_tracker.search import MatchOutcome

_SEARCH_FLAGS = {
    SearchEnd.STARS: "MaxStarsDetection",
    SearchEnd.INVALID: "MaxInvalidStarsDetectionError",
    SearchEnd.NOISE: "MaxNoiseDetected",
}


@dataclass(eq=False)
class Processing:
    """The processing functions, what they found in the latest picture, and how long each took."""

    meter: Meter
    state: State
    capture: ImageCapture
    catalogue: StarCatalogue
    results: Results = field(default_factory=Results)
    #: time of each step by name, since the last reset
    latest_ms: dict[str, float] = field(default_factory=dict)
    longest_ms: dict[str, float] = field(default_factory=dict)

    def process(self) -> Routine[bool]:
        """Detect, identify and estimate; False when a step failed."""
        identified = (yield from self.detect()) and (yield from self.identify())
        return identified and (yield from self.estimate())

    def capture_and_process(self) -> Routine[None]:
        """Capture a picture and process it; without one there is nothing to report."""
        if (yield from self.capture.get_image()):
            yield from self.process()
        else:
            self.discard_results()
            self._report(Reason.NO_PICTURE)

    @property
    def transitions(self) -> Automatic:
        return transitions_of(self.state, self.meter)

    @property
    def _switches(self) -> CubeStarSwitches:
        return self.state.switches.now

    @contextmanager
    def _cycles(self) -> Iterator[None]:
        """Record the cycle counter's difference for every phase that the block charges."""
        before = dict(self.meter.phases)
        yield
        for name, cycles in self.meter.phases.items():
            if spent := cycles - before.get(name, 0):
                self._record(name, 1_000_000 * spent // self.meter.table.clock_hz)

    def _record(self, name: str, duration_us: int) -> None:
        self.latest_ms[name] = duration_us / 1000
        self.longest_ms[name] = max(self.longest_ms.get(name, 0.0), duration_us / 1000)

    def _fail(self, status: TaskStatus, flag: str) -> bool:
        self.state.task_status = status
        self.state.raise_flag(flag)
        return False

    def discard_results(self) -> None:
        self.results = Results()
        self._withdraw()

    def _withdraw(self) -> None:
        self.state.retained.solved = 0
        self.state.quality = dict(UNRATED)

    def _report(self, reason: Reason) -> None:
        """Report in telemetry Quality why there is no attitude, if the switches want it rated."""
        if self._switches.estimate != "votes":
            self.state.quality = estimate.picture_values(self.results, reason)

    def _report_outcome(self, outcome: MatchOutcome) -> None:
        self._report(estimate.reason_of(self.results.detection, outcome))

    # --- detection ----------------------------------------------------------------------------

    def detect(self) -> Routine[bool]:
        self.discard_results()
        retained, settings = self.state.retained, self.state.settings
        if not retained.image_present:
            self._report(Reason.NO_PICTURE)
            return self._fail(TaskStatus.DETECTION_FAILED, "StatusError")
        self.state.task_status = TaskStatus.DETECTING
        started_us: int = yield ReadTimer()
        with self._cycles():
            detection = yield from self.capture.memory.search(
                configuration.detection_config(
                    settings,
                    plain_weights=self._switches.weights == "intensity",
                    background=self._switches.detection == "background",
                )
            )
            camera = configuration.camera_parameters(settings)
            with self.meter.phase("correction"):
                points = undistort(detection.centroids, camera, self.meter)
            with self.meter.phase("vectors"):
                vectors = unit_vectors(points, camera, self.meter)
        self._record("detection", (yield from phases.end(self.state, "detect_us", started_us)))
        if detection.end in _SEARCH_FLAGS:
            self.state.raise_flag(_SEARCH_FLAGS[detection.end])
        if len(vectors) < FEWEST_STARS:
            self.state.raise_flag("LessThanThreeStarsDetected")
        self.results = Results(
            detection, points, vectors, frame=retained.frame, image_ms=retained.image_ms
        )
        if self._switches.gyro == "on":
            with self._cycles(), self.meter.phase("gyro"):
                self.results.rate = measure_rate(self.state, self.results, self.meter)
        found = len(vectors) > 0
        if not found:
            self._report_outcome(MatchOutcome.TOO_FEW_CENTROIDS)
        self.state.task_status = TaskStatus.DETECTED if found else TaskStatus.DETECTION_FAILED
        return found

    # --- identification -----------------------------------------------------------------------

    def identify(self) -> Routine[bool]:
        results = self.results
        results.identification, results.best = None, []
        self._withdraw()
        if results.detection is None:
            return self._fail(TaskStatus.IDENTIFICATION_FAILED, "StatusError")
        self.state.task_status = TaskStatus.IDENTIFYING
        started_us: int = yield ReadTimer()
        listed = yield from self._list_bodies()
        results = self.results
        with self._cycles():
            results.mode = self.transitions.choose()
            searches = Searches(self.state, self.known, self.meter)
            identification = searches.run(results, self.transitions.cone_deg())
        self._record("identification", (yield from phases.end(self.state, "match_us", started_us)))
        if listed:
            results.bodies = (results.bodies or bodies.NO_BODIES) | bodies.summary(
                results.frame, listed, self.known, identification
            )
        if identification.outcome is not MatchOutcome.IDENTIFIED:
            searches.explain(results, identification)
            self.transitions.failed(results.mode)
            self._report_outcome(identification.outcome)
            return self._fail(
                TaskStatus.IDENTIFICATION_FAILED, OUTCOME_FLAGS[identification.outcome]
            )
        results.identification = identification
        self.state.task_status = TaskStatus.IDENTIFIED
        return True

    # --- attitude -----------------------------------------------------------------------------

    def select_best(self) -> Routine[bool]:
        """Select the three identified stars with the most votes, brighter ones first in a tie."""
        results = self.results
        if results.identification is None or results.detection is None:
            self.state.raise_flag("StatusError")
            return False
        started_us: int = yield ReadTimer()
        votes, intensity = results.identification.votes, results.detection.intensities
        identified = results.identification.matched
        order = np.lexsort((-intensity[identified].astype(int), -votes[identified].astype(int)))
        results.best = [int(star) for star in identified[order[:3]]]
        looked_at = 3 * len(identified)  # one pass for each of the three
        self.meter.charge(ram_read=2 * looked_at, i32_add=2 * looked_at, loop=looked_at)
        ended_us: int = yield ReadTimer()
        self._record("best", ended_us - started_us)
        return True

    def estimate(self) -> Routine[bool]:
        """Estimate the attitude from the identified stars; False too where it is not believed."""
        results, identification = self.results, self.results.identification
        if identification is None:
            return self._fail(TaskStatus.CALCULATION_FAILED, "QuestindexError")
        self.state.task_status = TaskStatus.CALCULATING
        started_us: int = yield ReadTimer()
        try:
            found = self._solve(identification)
        except AttitudeError:
            self.transitions.failed(results.mode)
            self._report_outcome(MatchOutcome.TOO_FEW_MATCHED)
            return self._fail(TaskStatus.CALCULATION_FAILED, "QuestindexError")
        page = self._switches.flash_store == "page"
        stored = dcm(found.quaternion, self.meter) if page else None
        attitude = Attitude(
            found.quaternion, results.frame, results.image_ms, found.stars, results.mode, stored
        )
        contradicted = self._moon_contradicts(found)
        believed = (
            not found.is_refused
            and not contradicted
            and self.transitions.believes(attitude, identification.false_alarm)
        )
        self._record("attitude", (yield from phases.end(self.state, "attitude_us", started_us)))
        if found.rating is not None:
            reason = Reason.SOLVED if believed else Reason.CONTRADICTION
            if found.is_refused:
                reason = Reason.LENS
                self.transitions.failed(results.mode)
            self.state.quality = estimate.rated(results, identification, found.rating, reason)
        if contradicted:
            self.transitions.failed(results.mode)
        if not believed:
            return self._fail(TaskStatus.CALCULATION_FAILED, "IDError")
        self.state.attitude = attitude
        self.transitions.solved()
        self.state.retained.hint_present = 0
        self.state.retained.solved = 1
        self.state.task_status = TaskStatus.CALCULATED
        return True

    def _solve(self, identification: Identification) -> Estimate:
        """The attitude with the weights that the switches select. Raises AttitudeError."""
        stars, accuracy = self.known.vectors, None
        if self.known is not self.catalogue:
            accuracy = bodies.accuracies(self.known, self._bodies())
            identification = bodies.usable(identification, accuracy)
        if self._switches.estimate == "votes":
            rotated = self._switches.equation == "rotated"
            return by_votes(self.results, identification, stars, self.meter, rotated=rotated)
        camera = configuration.camera_parameters(self.state.settings)
        return by_errors(self.results, identification, stars, camera, self.meter, accuracy=accuracy)

    # --- planets and Moon ---------------------------------------------------------------------

    @property
    def known(self) -> StarCatalogue:
        """The star list that the latest identities refer to, with planets."""
        return self.results.known or self.catalogue

    def _bodies(self) -> dict[int, Body]:
        """Bodies by number, whose directions hold at the time of the image."""
        if self._switches.bodies == "off":
            return {}
        self.meter.charge(flash_read=PAGE_BYTES // 4, i32_add=MOST_BODIES)
        now_s = self.results.image_ms // 1000
        return {at: one for at, one in enumerate(self.state.bodies) if one.until_s > now_s}

    def _list_bodies(self) -> Routine[dict[int, Body]]:
        """Let the searches know the planets, and find the Moon; returns all bodies."""
        listed, self.results.known, self.results.bodies = self._bodies(), None, None
        if listed:
            self.results.known = bodies.with_bodies(self.catalogue, listed, self.meter)
        if any(body.radius_rad for body in listed.values()):
            disc = yield from find_disc(self.capture.memory, self.meter)
            if disc is not None:
                self.results = bodies.beside(disc, self.results, self.meter)
            self.results.disc = disc
            self.results.bodies = bodies.NO_BODIES | bodies.disc_values(disc)
        return listed

    def _moon_contradicts(self, found: Estimate) -> bool:
        """Whether the Moon is not where the attitude puts it."""
        for body in self._bodies().values():
            if not body.radius_rad:
                continue
            camera = configuration.camera_parameters(self.state.settings)
            rotation = dcm(found.quaternion, self.meter)
            seen = bodies.check_disc(self.results.disc, body, rotation, camera, self.meter)
            self.results.bodies = (self.results.bodies or bodies.NO_BODIES) | seen
            if seen["Disc"] in (Disc.ABSENT, Disc.MISPLACED):
                return True
        return False
