"""The worst cases of a campaign, measured again to render their images."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.experiments.measure import MEASURE
from cubestack.host.experiments.scene_truth import picture_of
from cubestack.host.pictures.images import save_sample
from cubestack.host.studies.campaign.block import Row
from cubestack.host.studies.campaign.folder import Folder, again
from cubestack.host.studies.campaign.statistics import ERROR

ORDER = ("failed", "wrong", "refused", "right")
"""Outcomes, worst first."""


@dataclass(frozen=True)
class Case:
    """A row with its number in the file, a caption, and the image as JPEG, if any."""

    number: int
    text: str
    jpeg: bytes


def worst(folder: Folder, count: int) -> Iterator[Case]:
    """The worst cases first: by outcome, then by largest error.

    Each needs the run up to its frame. Only `measure` has images.
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
    """Outcome and reason, errors, and the swept options."""
    errors = ", ".join(f"{name} {value:.3g}" for name, value in _errors(row).items())
    swept = ", ".join(f"{name} = {value}" for name, value in row.swept.items())
    return "; ".join(part for part in (row.outcome, row.reason, errors, swept) if part)


def _picture(folder: Folder, row: Row) -> bytes:
    seen = list[AnyEmulated]()
    try:
        again(folder, row, seen.append)
    except Exception:  # it may fail again; images up to then are shown
        if row.outcome != "failed":
            raise
    picture = picture_of(seen[-1].board) if seen else None
    if picture is None:
        return b""
    written = BytesIO()
    save_sample(picture, written)
    return written.getvalue()
