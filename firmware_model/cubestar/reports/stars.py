"""Telemetry of single stars; frames that step give the next star at each read, and wrap."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cubestack.firmware_model.cubestar.processing import Processing, Results
from cubestack.firmware_model.interface.cubestar import INTERFACE

NOT_IDENTIFIED = 0xFFFF
NO_STAR = 0xFF

Values = dict[str, Any]


def _named(names: Sequence[str], vector: Sequence[float] | np.ndarray[Any, Any]) -> Values:
    return dict(zip(names, vector, strict=True))


class StarReports:
    """Values of the telemetry of detected, identified and selected stars.

    Attributes:
        sources: by name of the telemetry frame.
    """

    def __init__(self, processing: Processing) -> None:
        """Report on the results of ``processing``."""
        self._processing = processing
        self._cursors: dict[str, tuple[Results, int]] = {}
        self.sources: dict[str, Callable[[], Values]] = {
            "DetectionSummary": self._summary,
            "StarPositions": self._position,
            "BodyUnitVectors": self._body_vector,
            "NumIdStars": lambda: {"numIdStars": len(self._identified())},
            "IDStarsDetails": self._identity,
            "InertialUnitVectors": self._inertial_vector,
            "BestStarIndex": self._best,
            "Star1Details": lambda: self._selected(1),
            "Star2Details": lambda: self._selected(2),
            "Star3Details": lambda: self._selected(3),
            "StarDetails": self._details,
            "HipparcosNumber": self._hipparcos,
            "MatchSummary": self._match_summary,
        }

    @property
    def _results(self) -> Results:
        return self._processing.results

    def _identified(self) -> list[int]:
        identification = self._results.identification
        if identification is None:
            return []
        return [int(star) for star in identification.matched]

    def _step(self, frame: str, stars: Sequence[int]) -> int | None:
        """Next of ``stars`` for ``frame``; None without any. New results start over."""
        if not stars:
            return None
        results, position = self._cursors.get(frame, (self._results, 0))
        if results is not self._results:
            position = 0
        position %= len(stars)
        self._cursors[frame] = (self._results, position + 1)
        return stars[position]

    # --- detected stars -----------------------------------------------------------------------

    def _summary(self) -> Values:
        detection = self._results.detection
        return {
            "NumStarsDetected": len(self._results.vectors),
            "NumInvalidStars": 0 if detection is None else detection.invalid,
            "AmountOfNoise": 0 if detection is None else detection.noise,
            "ImageDarkValue": 0 if detection is None else detection.dark_value,
        }

    def _position(self) -> Values:
        detection = self._results.detection
        star = self._step("StarPositions", range(len(self._results.vectors)))
        if star is None or detection is None:
            nothing = INTERFACE.telemetry("StarPositions").reset_values()
            return {**nothing, "StarNumber": NO_STAR}
        return {
            **_named(("X_Coordinate", "Y_Coordinate"), detection.centroids[star]),
            **_named(
                ("X_CorrectedCoordinate", "Y_CorrectedCoordinate"), self._results.points[star]
            ),
            "StarNumber": star,
            "Size": detection.sizes[star],
            "Intensity": detection.intensities[star],
        }

    def _body_vector(self) -> Values:
        star = self._step("BodyUnitVectors", range(len(self._results.vectors)))
        vector = (0.0, 0.0, 0.0) if star is None else self._results.vectors[star]
        return {
            **_named(("VbX", "VbY", "VbZ"), vector),
            "StarNumber": NO_STAR if star is None else star,
        }

    def _details(self) -> Values:
        star = self._step("StarDetails", range(len(self._results.vectors)))
        point = (0.0, 0.0) if star is None else self._results.points[star]
        vector = (0.0, 0.0, 0.0) if star is None else self._results.vectors[star]
        identity, votes, confidence = self._match(star)
        return {
            "StarNumber": NO_STAR if star is None else star,
            **_named(("CCx", "CCy"), point),
            **_named(("Vbx", "Vby", "Vbz"), vector),
            "ID": identity,
            "ValidationVote": votes,
            "confidance": confidence,
        }

    # --- identified stars ---------------------------------------------------------------------

    def _match(self, star: int | None) -> tuple[int, int, float]:
        """Identity, votes and confidence (0 to 1) of a detected star."""
        identification = self._results.identification
        if star is None or identification is None or identification.stars[star] < 0:
            return NOT_IDENTIFIED, 0, 0.0
        return (
            int(identification.stars[star]),
            int(identification.votes[star]),
            float(identification.confidence[star]),
        )

    def _inertial(self, star: int | None) -> Sequence[float] | np.ndarray[Any, Any]:
        identity = self._match(star)[0]
        if identity == NOT_IDENTIFIED:
            return (0.0, 0.0, 0.0)
        return np.asarray(self._processing.catalogue.vectors[identity])

    def _identity(self) -> Values:
        star = self._step("IDStarsDetails", self._identified())
        identity, votes, confidence = self._match(star)
        return {
            "StarNumber": NO_STAR if star is None else star,
            "Identity": identity,
            "ValidationVotes": votes,
            "Confidence": 100 * confidence,
        }

    def _inertial_vector(self) -> Values:
        star = self._step("InertialUnitVectors", self._identified())
        identity, _, confidence = self._match(star)
        return {
            **_named(("ViX", "ViY", "ViZ"), self._inertial(star)),
            "StarNumber": NO_STAR if star is None else star,
            "Identity": identity,
            "Confidence": 100 * confidence,
        }

    def _hipparcos(self) -> Values:
        detection = self._results.detection
        star = self._step("HipparcosNumber", self._identified())
        if star is None or detection is None:
            return {"StarNumber": NO_STAR, "Hipparcos": 0, "X": 0.0, "Y": 0.0}
        return {
            "StarNumber": star,
            "Hipparcos": int(self._processing.catalogue.hip[self._match(star)[0]]),
            **_named(("X", "Y"), detection.centroids[star]),
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
        return _named(("Star1Index", "Star2Index", "Star3Index"), chosen)

    def _selected(self, number: int) -> Values:
        best, detection = self._results.best, self._results.detection
        star = best[number - 1] if number <= len(best) else None
        known = star is not None and detection is not None
        centroid = detection.centroids[star] if known and detection else (0.0, 0.0)
        identity, _, confidence = self._match(star)
        body = self._results.vectors[star] if star is not None else (0.0, 0.0, 0.0)
        prefix = f"S{number}"
        return {
            **_named((f"{prefix}CentX", f"{prefix}CentY"), centroid),
            f"{prefix}Mag": detection.intensities[star] if known and detection else 0,
            **_named([f"{prefix}VB{axis}" for axis in "XYZ"], body),
            **_named([f"{prefix}VI{axis}" for axis in "XYZ"], self._inertial(star)),
            f"{prefix}Conf": 100 * confidence,
            f"{prefix}CatNum": identity,
        }
