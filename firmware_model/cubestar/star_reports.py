"""Telemetry of single stars; stepping frames return the next star at each read, and wrap."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from cubestack.firmware_model.cubestar.detection import Detection
from cubestack.firmware_model.cubestar.processing.chain import Processing
from cubestack.firmware_model.cubestar.processing.identify import Results
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.telemetry import UNIT_VECTOR_SCALE

NOT_IDENTIFIED = 0xFFFF
NO_STAR = 0xFF

_NOTHING = {
    "StarNumber": NO_STAR,
    **dict.fromkeys(("Identity", "ID", "S1CatNum", "S2CatNum", "S3CatNum"), NOT_IDENTIFIED),
}
"""Non-zero values in a frame without a star."""

Values = dict[str, Any]


def by_name(names: Iterable[str], vector: Iterable[Any]) -> Values:
    return dict(zip(names, vector, strict=True))


class StarReports:
    """Values of the telemetry of detected, identified and selected stars."""

    def __init__(self, processing: Processing) -> None:
        self._processing = processing
        self._cursors: dict[str, tuple[Results, int]] = {}
        #: by name of the telemetry frame
        self.sources: dict[str, Callable[[], Values]] = {
            "DetectionSummary": self.summary,
            "StarPositions": self._stepping("StarPositions", self._detected, self._position),
            "BodyUnitVectors": self._stepping("BodyUnitVectors", self._detected, self._body_vector),
            "NumIdStars": lambda: {"numIdStars": len(self._identified())},
            "IDStarsDetails": self._stepping("IDStarsDetails", self._identified, self._identity),
            "InertialUnitVectors": self._stepping(
                "InertialUnitVectors", self._identified, self._inertial_vector
            ),
            "BestStarIndex": self._best,
            "Star1Details": lambda: self._selected(1),
            "Star2Details": lambda: self._selected(2),
            "Star3Details": lambda: self._selected(3),
            "StarDetails": self._stepping("StarDetails", self._detected, self._details),
            "HipparcosNumber": self._stepping("HipparcosNumber", self._identified, self._hipparcos),
            "MatchSummary": self._match_summary,
        }

    @property
    def _results(self) -> Results:
        return self._processing.results

    @property
    def _detection(self) -> Detection:
        assert self._results.detection is not None, "there is no star"
        return self._results.detection

    def _detected(self) -> Sequence[int]:
        return range(len(self._results.vectors))

    def _identified(self) -> Sequence[int]:
        identification = self._results.identification
        return [] if identification is None else identification.matched.tolist()

    def _stepping(
        self, frame: str, stars: Callable[[], Sequence[int]], values: Callable[[int], Values]
    ) -> Callable[[], Values]:
        """A source of ``values`` for the next of ``stars`` at each call; new results start over."""

        def source() -> Values:
            if not (listed := stars()):
                return _empty_frame(frame)
            results, position = self._cursors.get(frame, (self._results, 0))
            position = position % len(listed) if results is self._results else 0
            self._cursors[frame] = (self._results, position + 1)
            return {"StarNumber": listed[position], **values(listed[position])}

        return source

    # --- detected stars -----------------------------------------------------------------------

    def summary(self) -> Values:
        detection = self._results.detection
        return {
            "NumStarsDetected": len(self._results.vectors),
            "NumInvalidStars": 0 if detection is None else detection.invalid,
            "AmountOfNoise": 0 if detection is None else detection.noise,
            "ImageDarkValue": 0 if detection is None else detection.dark_value,
        }

    def _position(self, star: int) -> Values:
        corrected = ("X_CorrectedCoordinate", "Y_CorrectedCoordinate")
        return {
            **by_name(("X_Coordinate", "Y_Coordinate"), self._detection.centroids[star].tolist()),
            **by_name(corrected, self._results.points[star].tolist()),
            "Size": self._detection.sizes[star],
            "Intensity": self._detection.intensities[star],
        }

    def _body_vector(self, star: int) -> Values:
        return by_name(("VbX", "VbY", "VbZ"), self._results.vectors[star].tolist())

    def _details(self, star: int) -> Values:
        return {
            **by_name(("CCx", "CCy"), self._results.points[star]),
            **by_name(("Vbx", "Vby", "Vbz"), UNIT_VECTOR_SCALE * self._results.vectors[star]),
            **by_name(("ID", "ValidationVote", "confidance"), self._match(star)),
        }

    # --- identified stars ---------------------------------------------------------------------

    def _match(self, star: int) -> tuple[int, int, float]:
        """Identity, votes and confidence (0 to 1) of a detected star."""
        identification = self._results.identification
        if identification is None or identification.stars[star] < 0:
            return NOT_IDENTIFIED, 0, 0.0
        return (
            int(identification.stars[star]),
            int(identification.votes[star]),
            float(identification.confidence[star]),
        )

    def _identity(self, star: int) -> Values:
        identity, votes, confidence = self._match(star)
        return {"Identity": identity, "ValidationVotes": votes, "Confidence": 100 * confidence}

    def _inertial_vector(self, star: int) -> Values:
        identity, _, confidence = self._match(star)
        return {
            **by_name(("ViX", "ViY", "ViZ"), self._processing.known.vectors[identity]),
            "Identity": identity,
            "Confidence": 100 * confidence,
        }

    def _hipparcos(self, star: int) -> Values:
        return {
            "Hipparcos": int(self._processing.known.hip[self._match(star)[0]]),
            **by_name(("X", "Y"), self._detection.centroids[star].tolist()),
        }

    def _match_summary(self) -> Values:
        matches = [self._match(star) for star in self._identified()]
        return {
            "Detected": len(self._results.vectors),
            "Matched": len(matches),
            "MeanConfidence": float(np.mean([m[2] for m in matches])) if matches else 0.0,
            "MaxVotes": max((m[1] for m in matches), default=0),
        }

    # --- selected stars -----------------------------------------------------------------------

    def _best(self) -> Values:
        chosen = [*self._results.best, NO_STAR, NO_STAR, NO_STAR][:3]
        return by_name(("Star1Index", "Star2Index", "Star3Index"), chosen)

    def _selected(self, number: int) -> Values:
        if number > len(self._results.best):
            return _empty_frame(f"Star{number}Details")
        star, prefix = self._results.best[number - 1], f"S{number}"
        identity, _, confidence = self._match(star)
        inertial = self._processing.known.vectors[identity]
        return {
            **by_name((f"{prefix}CentX", f"{prefix}CentY"), self._detection.centroids[star]),
            f"{prefix}Mag": self._detection.intensities[star],
            **by_name([f"{prefix}VB{axis}" for axis in "XYZ"], self._results.vectors[star]),
            **by_name([f"{prefix}VI{axis}" for axis in "XYZ"], inertial),
            f"{prefix}Conf": 100 * confidence,
            f"{prefix}CatNum": identity,
        }


def _empty_frame(frame: str) -> Values:
    values = INTERFACE.telemetry(frame).reset_values()
    return {name: _NOTHING.get(name, value) for name, value in values.items()}
