"""From picture to attitude: detection, matching and QUEST, with the time of each step.

CubeStar thesis, sections 5.3.3 to 5.3.5. What the mode flag selects is published, and that an
attitude leads to tracking (section 6.1). The rest is assumed: a failure leads one step back
(tracking, assisted, lost in space), and the flag counts once setIDMode wants tracking; or, with
switch `transitions`, it always counts, a failure leads to lost in space, and so does setIDMode when
it wants that. Without an attitude and a hint (telecommand setTrackingMode) the node is lost in
space, whatever the flag says.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.confirmation import scaled
from cubestack.firmware_model.attitude.geometry import direction_of, undistort, unit_vectors
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.cubestar import configuration, phases
from cubestack.firmware_model.cubestar.capture import ImageCapture
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.detection import Detection, SearchEnd
from cubestack.firmware_model.cubestar.matching import confirmed, voting
from cubestack.firmware_model.cubestar.matching.identification import Identification, MatchOutcome
from cubestack.firmware_model.cubestar.matching.tracking import track
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG
from cubestack.firmware_model.cubestar.state import Attitude, State
from cubestack.firmware_model.interface.cubestar.codes import IdMode, MatchMode, TaskStatus
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
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
    MatchOutcome.UNCONFIRMED: "IDError",
    MatchOutcome.AMBIGUOUS: "IDError",
    MatchOutcome.NO_TIME: "IDError",
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


@dataclass(eq=False)
class Processing:
    """The processing functions, what they found in the latest picture, and how long each took.

    Attributes:
        latest_ms, longest_ms: time of each step by name, since the last reset.
    """

    meter: Meter
    state: State
    capture: ImageCapture
    catalogue: StarCatalogue
    results: Results = field(default_factory=Results)
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
        """There is nothing to report about the latest picture."""
        self.results = Results()
        self.state.retained.solved = 0

    # --- detection ----------------------------------------------------------------------------

    def detect(self) -> Routine[bool]:
        """Find the stars of the picture and their camera unit vectors."""
        self.discard_results()
        retained, settings = self.state.retained, self.state.settings
        if not retained.image_present:
            return self._fail(TaskStatus.DETECTION_FAILED, "StatusError")
        self.state.task_status = TaskStatus.DETECTING
        started_us: int = yield ReadTimer()
        with self._cycles():
            detection = yield from self.capture.pictures.search(
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
        found = len(vectors) > 0
        self.state.task_status = TaskStatus.DETECTED if found else TaskStatus.DETECTION_FAILED
        return found

    # --- identification -----------------------------------------------------------------------

    def identify(self) -> Routine[bool]:
        """Find the catalogue star of each detected one."""
        results = self.results
        results.identification, results.best = None, []
        self.state.retained.solved = 0
        if results.detection is None:
            return self._fail(TaskStatus.IDENTIFICATION_FAILED, "StatusError")
        self.state.task_status = TaskStatus.IDENTIFYING
        started_us: int = yield ReadTimer()
        with self._cycles():
            results.mode = self._choose_mode()
            identification = self._match(results.mode, results.vectors)
        self._record("identification", (yield from phases.end(self.state, "match_us", started_us)))
        if identification.outcome is not MatchOutcome.IDENTIFIED:
            self._explain_failure(identification)
            self._step_back()
            return self._fail(
                TaskStatus.IDENTIFICATION_FAILED, _OUTCOME_FLAGS[identification.outcome]
            )
        results.identification = identification
        self.state.task_status = TaskStatus.IDENTIFIED
        return True

    def _choose_mode(self) -> MatchMode:
        if self._switches.transitions == "automatic":
            lost = self.state.mode is MatchMode.LOST_IN_SPACE
        else:
            lost = self.state.settings.get("setIDMode", "IdMode") == IdMode.LOST_IN_SPACE
        if lost:
            return MatchMode.LOST_IN_SPACE
        if self.state.attitude is None and not self.state.retained.hint_present:
            self.state.raise_flag("IDModeError")
            return MatchMode.LOST_IN_SPACE
        return self.state.mode

    def _match(self, mode: MatchMode, vectors: NDArray[np.float32]) -> Identification:
        margin = float(self.state.settings.get("setIDMargin", "Margin"))
        catalogue = self.catalogue.limited(float(self._switches.pair_limit))
        meter, attitude = self.meter, self.state.attitude
        if mode is MatchMode.TRACKING and attitude is not None:
            return track(
                vectors,
                catalogue,
                self._rotation(attitude),
                meter,
                margin_rad=margin,
                field=configuration.field(self.state.settings)
                if self._switches.tracking == "verified"
                else None,
                radius_deg=self._radius_deg(mode),
            )
        boresight = None if mode is MatchMode.LOST_IN_SPACE else self._expected_boresight()
        if self._switches.voting == "algorithm-2":
            return voting.identify(
                vectors, catalogue, meter, boresight=boresight, margin_rad=margin
            )
        detection = self.results.detection
        return confirmed.identify(
            vectors,
            None if detection is None else detection.intensities,
            catalogue,
            configuration.field(self.state.settings),
            meter,
            boresight=boresight,
            margin_rad=margin,
        )

    def _expected_boresight(self) -> NDArray[np.float32]:
        """The hint until the first fix after it, then the boresight of the latest attitude."""
        attitude = self.state.attitude
        if attitude is None or self.state.retained.hint_present:
            hint = self.state.settings.all("setTrackingMode")
            return direction_of(hint["RightAscension"], hint["Declination"], self.meter)
        return np.asarray(self._rotation(attitude)[2])

    def _rotation(self, attitude: Attitude) -> NDArray[np.float32]:
        """Direction cosine matrix of the latest attitude, from flash if it is there."""
        if attitude.rotation is None:
            return dcm(attitude.quaternion, self.meter)
        self.meter.charge(flash_read=9)
        return attitude.rotation

    def _radius_deg(self, mode: MatchMode) -> float:
        tracking = mode is MatchMode.TRACKING
        return float(self._switches.reduction) if tracking else CUT_RADIUS_DEG

    def _explain_failure(self, identification: Identification) -> None:
        """Raise the flags that say more about a failure than its outcome."""
        too_few = identification.outcome is MatchOutcome.TOO_FEW_MATCHED
        if too_few and not identification.votes.any():
            self.state.raise_flag("IDSearchError")
        mode = self.results.mode
        if mode is MatchMode.LOST_IN_SPACE:
            return
        if mode is MatchMode.TRACKING and too_few:
            self.state.raise_flag("RateExceeded")
        boresight = self._expected_boresight()
        edge = configuration.field_cosine(configuration.camera_parameters(self.state.settings))
        in_field = self.catalogue.within(boresight, edge, self.meter)
        if len(in_field) < FEWEST_STARS:
            self.state.raise_flag("LessThanThreeStarsInFoV")
        if not len(self.catalogue.near(boresight, self._radius_deg(mode), self.meter)):
            self.state.raise_flag("ReducedIDListSizeError")

    def _step_back(self) -> None:
        lost = MatchMode.LOST_IN_SPACE
        automatic = self._switches.transitions == "automatic"
        self.state.mode = lost if automatic else MatchMode(min(self.results.mode + 1, lost))

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
        """Estimate the attitude from the identified stars, weighted with their votes."""
        results, identification = self.results, self.results.identification
        if identification is None:
            return self._fail(TaskStatus.CALCULATION_FAILED, "QuestindexError")
        self.state.task_status = TaskStatus.CALCULATING
        started_us: int = yield ReadTimer()
        kept = identification.matched
        inertial = self.catalogue.vectors[identification.stars[kept]]
        weights = identification.votes[kept].astype(np.float32)
        try:
            measured = scaled(results.vectors[kept], 1 / identification.scale, self.meter)
            quaternion = quest(measured, inertial, weights, self.meter)
        except AttitudeError:
            self._step_back()
            return self._fail(TaskStatus.CALCULATION_FAILED, "QuestindexError")
        stored = dcm(quaternion, self.meter) if self._switches.flash_store == "page" else None
        self._record("attitude", (yield from phases.end(self.state, "attitude_us", started_us)))
        self.state.attitude = Attitude(
            quaternion, results.frame, results.image_ms, len(kept), results.mode, stored
        )
        self.state.mode = MatchMode.TRACKING
        self.state.retained.hint_present = 0
        self.state.retained.solved = 1
        self.state.task_status = TaskStatus.CALCULATED
        return True
