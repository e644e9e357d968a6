"""What the theses say of the methods, as statements that the figures confirm or not.

Where a thesis names no measure, the check says which one was taken.
"""

from collections.abc import Callable

from cubestack.host.studies.compare.skies import CASES
from cubestack.host.studies.compare.study import Rows, Verdict
from cubestack.host.studies.compare.tracker import Tracker

USUAL, ONE_FALSE, HARDEST = CASES[0].name, CASES[1].name, CASES[3].name
CLASSIC = ("triangle", "match group", "grid")  #: of the CubeStar thesis' table 4.1, in its order


def _falling(figure: str, case: str = USUAL) -> Callable[[Rows, Tracker], bool]:
    """Whether a figure falls over the classic methods."""

    def check(rows: Rows, _tracker: Tracker) -> bool:
        first, second, third = (rows(method, case, figure) for method in CLASSIC)
        return first > second > third

    return check


def _only_triangles_too_large(rows: Rows, tracker: Tracker) -> bool:
    sizes = {method: rows(method, USUAL, "database_bytes") for method in CLASSIC}
    return (
        sizes["triangle"] > tracker.room_bytes
        and max(sizes["match group"], sizes["grid"]) < tracker.room_bytes
    )


VERDICTS = (
    Verdict(
        "the triangle algorithm has the largest catalogue, the grid algorithm the smallest",
        "S table 4.1",
        _falling("database_bytes"),
    ),
    Verdict(
        "the triangle algorithm's catalogue does not fit into the part's flash, the others do",
        "S 4.2.2",
        _only_triangles_too_large,
    ),
    Verdict(
        "the match group algorithm needs more RAM than the two others",
        "S table 4.1",
        lambda rows, _: (
            rows("match group", USUAL, "ram_bytes")
            > max(rows(method, USUAL, "ram_bytes") for method in ("triangle", "grid"))
        ),
    ),
    Verdict(
        "triangles are slowest, the grid fastest (mean time)", "S table 4.1", _falling("mean_ms")
    ),
    Verdict(
        f"triangles are least robust, the grid most (right with {HARDEST})",
        "S table 4.1",
        lambda rows, _: (
            rows("triangle", HARDEST, "right")
            < rows("match group", HARDEST, "right")
            < rows("grid", HARDEST, "right")
        ),
    ),
    Verdict(
        "the grid does not suit sparse images (less right than voting on undisturbed skies)",
        "S 4.2.2",
        lambda rows, _: rows("grid", USUAL, "right") < rows("geometric voting", USUAL, "right"),
    ),
    Verdict(
        "grid matching is a light load (less time than match group and voting)",
        "A 5.2",
        lambda rows, _: (
            rows("grid", USUAL, "mean_ms")
            < min(rows(method, USUAL, "mean_ms") for method in ("match group", "geometric voting"))
        ),
    ),
    Verdict(
        "a list of angles takes much less memory than one of planar triangles (a fifth)",
        "A 2.3.2",
        lambda rows, _: (
            rows("angle", USUAL, "database_bytes")
            < rows("planar triangle", USUAL, "database_bytes") / 5
        ),
    ),
    Verdict(
        "spherical triangles are faster than angles (mean time)",
        "A 5.4",
        lambda rows, _: (
            rows("spherical triangle", USUAL, "mean_ms") < rows("angle", USUAL, "mean_ms")
        ),
    ),
    Verdict(
        "planar triangles are much cheaper than spherical ones (half the time)",
        "A 5.5",
        lambda rows, _: (
            rows("planar triangle", USUAL, "mean_ms")
            < rows("spherical triangle", USUAL, "mean_ms") / 2
        ),
    ),
    Verdict(
        "geometric voting is as fast as the fastest (no slower than the pyramid algorithm)",
        "S 4.3.1",
        lambda rows, _: (
            rows("geometric voting", USUAL, "mean_ms") <= rows("pyramid", USUAL, "mean_ms")
        ),
    ),
    Verdict(
        f"and more robust (no less right than triangles, match group and grid with {HARDEST})",
        "S 4.3.1",
        lambda rows, _: (
            rows("geometric voting", HARDEST, "right")
            >= max(rows(method, HARDEST, "right") for method in CLASSIC)
        ),
    ),
    Verdict(
        "geometric voting names no star wrongly",
        "S 4.3.5",
        lambda rows, _: all(not rows("geometric voting", case.name, "wrong") for case in CASES),
    ),
    Verdict(
        "geometric voting becomes worse with false stars (less right with 10 than with 1)",
        "S 4.3.5",
        lambda rows, _: (
            rows("geometric voting", HARDEST, "right")
            < rows("geometric voting", ONE_FALSE, "right")
        ),
    ),
)
