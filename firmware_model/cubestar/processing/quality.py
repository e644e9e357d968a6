"""What telemetry Quality tells about the latest picture."""

from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.processing.results import Results
from cubestack.firmware_model.cubestar.state import UNRATED
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar.codes import Reason
from cubestack.firmware_model.star_tracker.rating import Rating


def told(results: Results, reason: Reason) -> dict[str, Value]:
    """Values of a picture that gave no attitude for ``reason``."""
    values = UNRATED | {"FrameCounter": results.frame, "Reason": reason}
    picture = None if results.detection is None else results.detection.statistics
    if picture is not None:
        values |= {
            "Background": picture.background,
            "BackgroundRange": picture.background_range,
            "Noise": picture.noise,
            "Saturated": picture.saturated,
            "Spikes": picture.spikes,
            "Elongated": picture.elongated,
        }
    return values


def rated(
    results: Results, identification: Identification, rating: Rating, reason: Reason
) -> dict[str, Value]:
    """Values of a picture that gave an attitude; it is valid if ``reason`` says SOLVED."""
    valid, matched = reason is Reason.SOLVED, len(identification.matched)
    return told(results, reason) | rating.values(matched, identification.expected, valid=valid)
