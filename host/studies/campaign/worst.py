"""The worst cases of a campaign, measured again to show what the cameras saw."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.experiments.measure import MEASURE
from cubestack.host.experiments.rendered import picture_of
from cubestack.host.pictures.hazards import save_sample
from cubestack.host.studies.campaign.block import Row
from cubestack.host.studies.campaign.folder import Folder
from cubestack.host.studies.campaign.run import again
from cubestack.host.studies.campaign.statistics import ERROR

ORDER = ("failed", "wrong", "refused", "right")
"""Of outcomes, the worst first."""


@dataclass(frozen=True)
class Case:
    """A row with its number in the file, what there is to say, and the picture as JPEG, if any."""

    number: int
    text: str
    jpeg: bytes


def worst(folder: Folder, count: int) -> Iterator[Case]:
    """The worst cases, the worst first: by outcome, then by the largest error.

    Each costs what it took to come to its frame. Only pictures of `measure` are shown.
    """
    if folder.plan.command != MEASURE:
        return
    rows = sorted(enumerate(folder.rows()), key=lambda each: _badness(each[1]))
    for number, row in rows[:count]:
        yield Case(number, _told(row), _picture(folder, row))


def _badness(row: Row) -> tuple[int, float]:
    return ORDER.index(row.outcome), -max(_errors(row).values(), default=0.0)


def _errors(row: Row) -> dict[str, float]:
    return {
        name: abs(value)
        for name, value in row.result.items()
        if name.startswith(ERROR) and isinstance(value, int | float)
    }


def _told(row: Row) -> str:
    """Outcome and reason, errors, and where it stands in what was swept."""
    errors = ", ".join(f"{name} {value:.3g}" for name, value in _errors(row).items())
    swept = ", ".join(f"{name} = {value}" for name, value in row.swept.items())
    return "; ".join(part for part in (row.outcome, row.reason, errors, swept) if part)


def _picture(folder: Folder, row: Row) -> bytes:
    seen = list[AnyEmulated]()
    try:
        again(folder, row, seen.append)
    except Exception:  # it failed before, and may again: what was seen until then counts
        if row.outcome != "failed":
            raise
    picture = picture_of(seen[-1].board) if seen else None
    if picture is None:
        return b""
    written = BytesIO()
    save_sample(picture, written)
    return written.getvalue()
