"""The comparison of attitudes as the command and the page show it."""

from math import isnan

from cubestack.host.studies.compare.attitude.methods import methods
from cubestack.host.studies.compare.attitude.run import SMOOTHING
from cubestack.host.studies.compare.attitude.trials import CASES
from cubestack.host.studies.compare.attitude.verdicts import USUAL, VERDICTS
from cubestack.host.studies.compare.plots import errors_and_times
from cubestack.host.studies.compare.study import Cell, Rows, Study, Table, number

NAMES = {method.name: method.source for method in methods()} | {SMOOTHING: "A 6.2"}


def _errors(case: str) -> Cell:
    """Errors across and about the boresight, a dash where no attitude was near."""

    def cell(rows: Rows, method: str) -> str:
        both = [rows(method, case, f"{axis}_arcsec") for axis in ("cross", "roll")]
        return "-" if isnan(both[0]) else " / ".join(f"{error:.3g}" for error in both)

    return cell


def _lost(case: str) -> Cell:
    return lambda rows, method: " / ".join(
        f"{rows(method, case, figure):.0f}" for figure in ("refused", "far")
    )


STUDY = Study(
    name="attitude",
    skies=200,
    rows=len(NAMES) * len(CASES),
    methods=NAMES,
    tables=(
        Table(
            "root mean square error across / about the boresight, in arcsec",
            {case.name: _errors(case.name) for case in CASES},
        ),
        Table(
            "attitudes refused / off by more than a degree, in %",
            {case.name: _lost(case.name) for case in CASES},
        ),
        Table(
            f"cost of an image ({USUAL})",
            {
                "operations, thousands": number("operations", USUAL, ".2f", 1000),
                "mean, ms": number("mean_ms", USUAL, ".3f"),
                "longest, ms": number("longest_ms", USUAL, ".3f"),
                "farthest from a rotation": number("defect", USUAL, ".0e"),
            },
        ),
    ),
    verdicts=VERDICTS,
    plot=lambda found: errors_and_times(found, list(NAMES), [case.name for case in CASES], USUAL),
)
