"""The search of each mode, and the flags of its failure: CubeStar thesis, section 5.3.4."""

from dataclasses import dataclass, field
from math import acos, degrees

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import direction_of
from cubestack.firmware_model.attitude.quest import dcm
from cubestack.firmware_model.cubestar import configuration
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.detection import Detection
from cubestack.firmware_model.cubestar.detection.disc import SeenDisc
from cubestack.firmware_model.cubestar.matching import confirmed, voting
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.matching.tracking import track
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG
from cubestack.firmware_model.cubestar.state import Attitude, State
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar.codes import MatchMode
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.search import MatchOutcome

#: Stars that an identification needs when nothing is known (sections 4.3.5 and 5.3.4).
FEWEST_STARS = 3

_U32 = 0xFFFF_FFFF

OUTCOME_FLAGS = {
    MatchOutcome.TOO_FEW_CENTROIDS: "LessThanThreeStarsDetected",
    MatchOutcome.TOO_FEW_MATCHED: "LessThanThreeStarsID",
    MatchOutcome.MIRRORED: "IDError",
    MatchOutcome.UNCONFIRMED: "IDError",
    MatchOutcome.AMBIGUOUS: "IDError",
    MatchOutcome.NO_TIME: "IDError",
}


@dataclass
class Results:
    """Results of the latest picture; each is None until its step succeeded."""

    detection: Detection | None = None  #: centroids and counts
    #: undistorted centroids (n, 2) in px
    points: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    #: camera unit vectors (n, 3)
    vectors: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    identification: Identification | None = None  #: identity of each centroid
    mode: MatchMode = MatchMode.LOST_IN_SPACE  #: MatchMode that identified it
    best: list[int] = field(default_factory=list)  #: indices of the selected stars, at most three
    #: number and time of the picture, as in ``Attitude``
    frame: int = 0
    image_ms: int = 0
    #: the star list that the identities refer to, with planets; None: the catalogue's own
    known: StarCatalogue | None = None
    disc: SeenDisc | None = None  #: the Moon's, if it was sought and seen
    #: values of telemetry Bodies; None until it ran
    bodies: dict[str, Value] | None = None
    #: values of telemetry StellarGyro; None until it ran
    rate: dict[str, Value] | None = None


class Searches:
    """Lost in space, assisted and tracking, as the switches select."""

    def __init__(self, state: State, catalogue: StarCatalogue, meter: Meter) -> None:
        self._state, self._catalogue, self._meter = state, catalogue, meter

    def run(self, results: Results, cone_deg: float) -> Identification:
        """Identify the stars of ``results`` in its mode; ``cone_deg``: largest error of the
        expected boresight."""
        state, meter, switches = self._state, self._meter, self._state.switches.now
        mode, vectors, attitude = results.mode, results.vectors, self._state.attitude
        margin = float(state.settings.get("setIDMargin", "Margin"))
        view = configuration.field(state.settings)
        if results.detection is not None and results.detection.blind is not None:
            view = view.without(results.detection.blind)
        catalogue = self._catalogue.with_pair_limit(float(switches.pair_limit))
        if mode is MatchMode.TRACKING and attitude is not None:
            return track(
                vectors,
                catalogue,
                self._rotation(attitude),
                meter,
                margin_rad=margin,
                field=view if switches.tracking == "verified" else None,
                radius_deg=self._radius_deg(mode),
                apart_s=((results.image_ms - attitude.image_ms) & _U32) / 1000,
            )
        boresight = None if mode is MatchMode.LOST_IN_SPACE else self._expected_boresight()
        if switches.voting == "algorithm-2":
            return voting.identify(
                vectors, catalogue, meter, boresight=boresight, margin_rad=margin
            )
        return confirmed.identify(
            vectors,
            None if results.detection is None else results.detection.intensities,
            catalogue,
            view,
            meter,
            boresight=boresight,
            margin_rad=margin,
            radius_deg=degrees(acos(self._edge)) + cone_deg,
        )

    def explain(self, results: Results, identification: Identification) -> None:
        """Raise the flags that say more about a failure than its outcome."""
        raise_flag = self._state.raise_flag
        too_few = identification.outcome is MatchOutcome.TOO_FEW_MATCHED
        if too_few and not identification.votes.any():
            raise_flag("IDSearchError")
        mode = results.mode
        if mode is MatchMode.LOST_IN_SPACE:
            return
        if mode is MatchMode.TRACKING and too_few:
            raise_flag("RateExceeded")
        boresight = self._expected_boresight()
        in_field = self._catalogue.within(boresight, self._edge, self._meter)
        if len(in_field) < FEWEST_STARS:
            raise_flag("LessThanThreeStarsInFoV")
        if not len(self._catalogue.near(boresight, self._radius_deg(mode), self._meter)):
            raise_flag("ReducedIDListSizeError")

    def _expected_boresight(self) -> NDArray[np.float32]:
        """The hint until the first fix after it, then the boresight of the latest attitude."""
        attitude = self._state.attitude
        if attitude is None or self._state.retained.hint_present:
            hint = self._state.settings.all("setTrackingMode")
            return direction_of(hint["RightAscension"], hint["Declination"], self._meter)
        return np.asarray(self._rotation(attitude)[2])

    def _rotation(self, attitude: Attitude) -> NDArray[np.float32]:
        """Direction cosine matrix of the latest attitude, from flash if it is there."""
        if attitude.rotation is None:
            return dcm(attitude.quaternion, self._meter)
        self._meter.charge(flash_read=9)
        return attitude.rotation

    @property
    def _edge(self) -> np.float32:
        return configuration.field_cosine(configuration.camera_parameters(self._state.settings))

    def _radius_deg(self, mode: MatchMode) -> float:
        tracking = mode is MatchMode.TRACKING
        return float(self._state.switches.now.reduction) if tracking else CUT_RADIUS_DEG
