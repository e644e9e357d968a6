"""From picture to attitude: detection, matching and QUEST, with the time of each step.

CubeStar thesis, sections 5.3.3 to 5.3.5. What the mode flag selects is published; how it changes
is not, so it is assumed: an attitude leads to tracking, a failure leads one step back (tracking,
assisted, lost in space). Without an attitude and a hint (telecommand setTrackingMode) the node is
lost in space, whatever the flag says.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import direction_of, undistort, unit_vectors
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.cubestar.capture import ImageCapture
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.configuration import (
    camera_parameters,
    detection_config,
    field_radius_deg,
)
from cubestack.firmware_model.cubestar.detection import Detection, SearchEnd
from cubestack.firmware_model.cubestar.matching.assisted import CUT_RADIUS_DEG, identify_assisted
from cubestack.firmware_model.cubestar.matching.identification import Identification, MatchOutcome
from cubestack.firmware_model.cubestar.matching.tracking import track
from cubestack.firmware_model.cubestar.matching.voting import identify
from cubestack.firmware_model.cubestar.phases import Phases
from cubestack.firmware_model.cubestar.state import Attitude, State
from cubestack.firmware_model.interface.cubestar.codes import IdMode, MatchMode, TaskStatus
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine

_SEARCH_FLAGS = {
    SearchEnd.STARS: "MaxStarsDetection",
    SearchEnd.INVALID: "MaxInvalidStarsDetectionError",
    SearchEnd.NOISE: "MaxNoiseDetected",
}
FEWEST_STARS = 3
"""Stars that an identification needs when nothing is known (sections 4.3.5 and 5.3.4)."""

_OUTCOME_FLAGS = {
    MatchOutcome.TOO_FEW_CENTROIDS: "LessThanThreeStarsDetected",
    MatchOutcome.TOO_FEW_MATCHED: "LessThanThreeStarsID",
    MatchOutcome.MIRRORED: "IDError",
    MatchOutcome.CHANCE: "IDError",
}


@dataclass
class Results:
    """Results of the latest picture; each is None until its step succeeded.

    Attributes:
        detection: centroids and counts.
        points: undistorted centroids (n, 2) in px.
        vectors: camera unit vectors (n, 3).
        identification: identity of each centroid.
        mode: MatchMode that identified it.
        best: indices of the selected stars, at most three.
        frame, image_ms: number and time of the picture, as in ``Attitude``.
    """

    detection: Detection | None = None
    points: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    vectors: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    identification: Identification | None = None
    mode: MatchMode = MatchMode.LOST_IN_SPACE
    best: list[int] = field(default_factory=list)
    frame: int = 0
    image_ms: int = 0


class Processing:
    """The processing functions, and what they found.

    Attributes:
        results: of the latest picture.
        latest_ms, longest_ms: time of each step by name, since the last reset.
        catalogue: star list and pair list in flash.
    """

    def __init__(
        self,
        meter: Meter,
        state: State,
        capture: ImageCapture,
        phases: Phases,
        catalogue: StarCatalogue,
    ) -> None:
        """Work on the picture of ``capture`` with ``catalogue``."""
        self._meter = meter
        self._state = state
        self._capture = capture
        self._phases = phases
        self.catalogue = catalogue
        self.results = Results()
        self.latest_ms: dict[str, float] = {}
        self.longest_ms: dict[str, float] = {}

    def process(self) -> Routine[bool]:
        """Detect, identify and estimate; False when a step failed."""
        if not (yield from self.detect()):
            return False
        if not (yield from self.identify()):
            return False
        return (yield from self.estimate())

    @contextmanager
    def _cycles(self) -> Iterator[None]:
        """Record the cycle counter's difference for every phase that the block charges."""
        before = dict(self._meter.phases)
        yield
        for name, cycles in self._meter.phases.items():
            if spent := cycles - before.get(name, 0):
                self._record(name, 1_000_000 * spent // self._meter.table.clock_hz)

    def _record(self, name: str, duration_us: int) -> None:
        self.latest_ms[name] = duration_us / 1000
        self.longest_ms[name] = max(self.longest_ms.get(name, 0.0), duration_us / 1000)

    def _fail(self, status: TaskStatus, flag: str) -> bool:
        self._state.task_status = status
        self._state.raise_flag(flag)
        return False

    def discard_results(self) -> None:
        """There is nothing to report about the latest picture."""
        self.results = Results()
        self._state.retained.solved = 0

    # --- detection ----------------------------------------------------------------------------

    def detect(self) -> Routine[bool]:
        """Find the stars of the picture and their camera unit vectors."""
        self.discard_results()
        retained, settings = self._state.retained, self._state.settings
        if not retained.image_present:
            return self._fail(TaskStatus.DETECTION_FAILED, "StatusError")
        self._state.task_status = TaskStatus.DETECTING
        started_us: int = yield ReadTimer()
        with self._cycles():
            detection = yield from self._capture.pictures.search(detection_config(settings))
            camera = camera_parameters(settings)
            with self._meter.phase("correction"):
                points = undistort(detection.centroids, camera, self._meter)
            with self._meter.phase("vectors"):
                vectors = unit_vectors(points, camera, self._meter)
        self._record("detection", (yield from self._phases.end("detect_us", started_us)))
        if detection.end in _SEARCH_FLAGS:
            self._state.raise_flag(_SEARCH_FLAGS[detection.end])
        if len(vectors) < FEWEST_STARS:
            self._state.raise_flag("LessThanThreeStarsDetected")
        self.results = Results(
            detection, points, vectors, frame=retained.frame, image_ms=retained.image_ms
        )
        if not len(vectors):
            self._state.task_status = TaskStatus.DETECTION_FAILED
            return False
        self._state.task_status = TaskStatus.DETECTED
        return True

    # --- identification -----------------------------------------------------------------------

    def identify(self) -> Routine[bool]:
        """Find the catalogue star of each detected one."""
        results = self.results
        results.identification, results.best = None, []
        self._state.retained.solved = 0
        if results.detection is None:
            return self._fail(TaskStatus.IDENTIFICATION_FAILED, "StatusError")
        self._state.task_status = TaskStatus.IDENTIFYING
        started_us: int = yield ReadTimer()
        with self._cycles():
            results.mode = self._choose_mode()
            identification = self._match(results.mode, results.vectors)
        self._record("identification", (yield from self._phases.end("match_us", started_us)))
        if identification.outcome is not MatchOutcome.IDENTIFIED:
            self._explain_failure(identification)
            self._step_back()
            return self._fail(
                TaskStatus.IDENTIFICATION_FAILED, _OUTCOME_FLAGS[identification.outcome]
            )
        results.identification = identification
        self._state.task_status = TaskStatus.IDENTIFIED
        return True

    def _choose_mode(self) -> MatchMode:
        if self._state.settings.get("setIDMode", "IdMode") == IdMode.LOST_IN_SPACE:
            return MatchMode.LOST_IN_SPACE
        if self._state.attitude is None and not self._state.retained.hint_present:
            self._state.raise_flag("IDModeError")
            return MatchMode.LOST_IN_SPACE
        return self._state.mode

    def _match(self, mode: MatchMode, vectors: NDArray[np.float32]) -> Identification:
        margin = float(self._state.settings.get("setIDMargin", "Margin"))
        meter, catalogue, attitude = self._meter, self.catalogue, self._state.attitude
        if mode is MatchMode.LOST_IN_SPACE:
            return identify(vectors, catalogue, meter, margin_rad=margin)
        if mode is MatchMode.TRACKING and attitude is not None:
            rotation = dcm(attitude.quaternion, meter)
            return track(vectors, catalogue, rotation, meter, margin_rad=margin)
        return identify_assisted(
            vectors, catalogue, self._expected_boresight(), meter, margin_rad=margin
        )

    def _expected_boresight(self) -> NDArray[np.float32]:
        """The hint until the first fix after it, then the boresight of the latest attitude."""
        attitude = self._state.attitude
        if attitude is None or self._state.retained.hint_present:
            hint = self._state.settings.all("setTrackingMode")
            return direction_of(hint["RightAscension"], hint["Declination"], self._meter)
        boresight: NDArray[np.float32] = dcm(attitude.quaternion, self._meter)[2]
        return boresight

    def _explain_failure(self, identification: Identification) -> None:
        """Raise the flags that say more about a failure than its outcome."""
        too_few = identification.outcome is MatchOutcome.TOO_FEW_MATCHED
        if too_few and not identification.votes.any():
            self._state.raise_flag("IDSearchError")
        mode = self.results.mode
        if mode is MatchMode.LOST_IN_SPACE:
            return
        if mode is MatchMode.TRACKING and too_few:
            self._state.raise_flag("RateExceeded")
        boresight = self._expected_boresight()
        radius_deg = field_radius_deg(camera_parameters(self._state.settings))
        in_field = self.catalogue.near(boresight, radius_deg, self._meter)
        if len(in_field) < FEWEST_STARS:
            self._state.raise_flag("LessThanThreeStarsInFoV")
        if not len(self.catalogue.near(boresight, CUT_RADIUS_DEG, self._meter)):
            self._state.raise_flag("ReducedIDListSizeError")

    def _step_back(self) -> None:
        self._state.mode = MatchMode(min(self.results.mode + 1, MatchMode.LOST_IN_SPACE))

    # --- attitude -----------------------------------------------------------------------------

    def select_best(self) -> Routine[bool]:
        """Select the three identified stars with the most votes, brighter ones first in a tie."""
        results = self.results
        if results.identification is None or results.detection is None:
            self._state.raise_flag("StatusError")
            return False
        started_us: int = yield ReadTimer()
        votes, intensity = results.identification.votes, results.detection.intensities
        identified = results.identification.matched
        order = np.lexsort((-intensity[identified].astype(int), -votes[identified].astype(int)))
        results.best = [int(star) for star in identified[order[:3]]]
        looked_at = 3 * len(identified)  # one pass for each of the three
        self._meter.charge(ram_read=2 * looked_at, i32_add=2 * looked_at, loop=looked_at)
        ended_us: int = yield ReadTimer()
        self._record("best", ended_us - started_us)
        return True

    def estimate(self) -> Routine[bool]:
        """Estimate the attitude from the identified stars, weighted with their votes."""
        results = self.results
        identification = results.identification
        if identification is None:
            return self._fail(TaskStatus.CALCULATION_FAILED, "QuestindexError")
        self._state.task_status = TaskStatus.CALCULATING
        started_us: int = yield ReadTimer()
        kept = identification.matched
        inertial = self.catalogue.vectors[identification.stars[kept]]
        weights = identification.votes[kept].astype(np.float32)
        try:
            quaternion = quest(results.vectors[kept], inertial, weights, self._meter)
        except AttitudeError:
            self._step_back()
            return self._fail(TaskStatus.CALCULATION_FAILED, "QuestindexError")
        self._record("attitude", (yield from self._phases.end("attitude_us", started_us)))
        self._state.attitude = Attitude(
            quaternion, results.frame, results.image_ms, len(kept), results.mode
        )
        self._state.mode = MatchMode.TRACKING
        self._state.retained.hint_present = 0
        self._state.retained.solved = 1
        self._state.task_status = TaskStatus.CALCULATED
        return True
