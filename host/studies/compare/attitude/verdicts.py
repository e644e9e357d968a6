"""What the theses say of the methods, as statements that the figures confirm or not."""

from collections.abc import Callable
from math import hypot

from cubestack.host.studies.compare.attitude.methods import PRINTED, QUEST_1, methods
from cubestack.host.studies.compare.attitude.run import SMOOTHING
from cubestack.host.studies.compare.attitude.trials import CASES
from cubestack.host.studies.compare.study import Rows, Verdict
from cubestack.host.studies.compare.tracker import Tracker

USUAL, TURNED = CASES[0].name, CASES[-1].name
QUEST = QUEST_1.name
SAME = 1.01  #: factor within which errors are the same


def _error(rows: Rows, method: str) -> float:
    """Of all three axes together, in arcsec."""
    return hypot(*(rows(method, USUAL, f"{axis}_arcsec") for axis in ("cross", "roll")))


def _faster(factor: float) -> Callable[[Rows, Tracker], bool]:
    def check(rows: Rows, _tracker: Tracker) -> bool:
        return rows("q-method", USUAL, "mean_ms") > factor * rows(QUEST, USUAL, "mean_ms")

    return check


VERDICTS = (
    Verdict(
        "TRIAD wastes information (larger errors than QUEST)",
        "S 4.4.1",
        lambda rows, _: _error(rows, "TRIAD") > SAME * _error(rows, QUEST),
    ),
    Verdict("QUEST is faster than the q-method", "S 4.4.1", _faster(1)),
    Verdict("up to a thousand times faster", "S 4.4.1, A 6.2", _faster(1000)),
    Verdict(
        "later methods are no faster and no better than QUEST (SVD)",
        "S 4.4.1",
        lambda rows, _: (
            rows("SVD", USUAL, "mean_ms") >= rows(QUEST, USUAL, "mean_ms")
            and _error(rows, "SVD") * SAME >= _error(rows, QUEST)
        ),
    ),
    Verdict(
        "QUEST takes less than 10 ms",
        "S 5.3.5",
        lambda rows, _: max(rows(QUEST, case.name, "longest_ms") for case in CASES) < 10,
    ),
    Verdict(
        "QUEST is robust (as printed, no attitude refused or off after a half turn)",
        "S 4.4.1",
        lambda rows, _: not any(rows(PRINTED, TURNED, figure) for figure in ("refused", "far")),
    ),
    Verdict(
        "an eigenvalue of 1 is as precise as the root of the quartic",
        "A 6.2",
        lambda rows, _: _error(rows, QUEST) <= SAME * _error(rows, "QUEST, quartic"),
    ),
    Verdict(
        "a matrix of nine elements is a burden (plain DCM: larger errors than QUEST)",
        "A 6.1.1",
        lambda rows, _: _error(rows, "plain DCM") > SAME * _error(rows, QUEST),
    ),
    Verdict(
        "a Kalman filter smooths the output (smaller errors than all others)",
        "A 6.2",
        lambda rows, _: (
            _error(rows, SMOOTHING) < min(_error(rows, method.name) for method in methods())
        ),
    ),
)
