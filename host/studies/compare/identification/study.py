"""The comparison of identifications as the command and the page show it."""

from cubestack.host.studies.compare.identification.methods import methods
from cubestack.host.studies.compare.identification.verdicts import HARDEST, USUAL, VERDICTS
from cubestack.host.studies.compare.plots import rates_and_costs
from cubestack.host.studies.compare.skies import CASES
from cubestack.host.studies.compare.study import Cell, Study, Table, number

OUTCOMES = ("right", "refused", "wrong")


def _outcomes(case: str) -> Cell:
    return lambda rows, method: " / ".join(f"{rows(method, case, one):.0f}" for one in OUTCOMES)


METHODS = methods()

STUDY = Study(
    name="identification",
    skies=100,
    rows=len(METHODS) * len(CASES),
    methods={method.name: method.source for method in METHODS},
    tables=(
        Table(
            "images right / refused / wrong, in %",
            {case.name: _outcomes(case.name) for case in CASES},
        ),
        Table(
            f"memory; operations and time of an image ({USUAL}, and {HARDEST})",
            {
                "database, kB": number("database_bytes", USUAL, ".0f", 1000),
                "RAM, kB": number("ram_bytes", USUAL, ".1f", 1000),
                "operations, thousands": number("operations", USUAL, ".1f", 1000),
                "mean, ms": number("mean_ms", USUAL, ".2f"),
                "longest, ms": number("longest_ms", USUAL, ".2f"),
                f"mean with {HARDEST}, ms": number("mean_ms", HARDEST, ".2f"),
                f"longest with {HARDEST}, ms": number("longest_ms", HARDEST, ".2f"),
            },
        ),
    ),
    verdicts=VERDICTS,
    plot=lambda found: rates_and_costs(
        found,
        [method.name for method in METHODS],
        {case.name: case.false for case in CASES[:4]},
        USUAL,
    ),
)
