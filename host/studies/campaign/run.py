"""Runs a campaign into its folder, and single rows of it again."""

from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.studies.campaign.block import Row, frames_of, measured, perform, rows_of
from cubestack.host.studies.campaign.folder import Folder, FolderError
from cubestack.host.studies.campaign.plan import CampaignPlan, FrameBlock
from cubestack.host.studies.workers import performed


def run(folder: Folder, workers: int, scheduler: str | None = None) -> Iterator[Row]:
    """Measure the missing rows; yields each row of the folder, earlier ones first.

    Raises:
        FolderError: another process works on it.
        WorkersError: workers are unavailable or lost; finished blocks are kept.
        RuntimeError: all frames of the first finished block failed.
    """
    blocks = {block.number: block for block in folder.plan.blocks()}
    with folder.alone():
        whole = folder.repair({number: rows_of(block) for number, block in blocks.items()})
        yield from folder.rows()
        missing = [block for number, block in blocks.items() if number not in whole]
        for _, rows in performed(perform, missing, workers, scheduler):
            if not whole and all(row.outcome == "failed" for row in rows):
                raise RuntimeError(f"nothing can be measured: {rows[0].reason}")
            folder.add(rows)
            whole.add(rows[0].block)
            yield from rows
        folder.sort()


def count(plan: CampaignPlan) -> int:
    return sum(map(rows_of, plan.blocks()))


def replayed(folder: Folder, number: int) -> dict[str, Any]:
    """Measure again the frame of a row, counted from 0.

    Raises FolderError for an unknown row, and the frame's own errors.
    """
    rows = list(folder.rows())
    if not 0 <= number < len(rows):
        raise FolderError(f"{folder.path} has rows 0 to {len(rows) - 1}, not {number}")
    return again(folder, rows[number])


def again(
    folder: Folder, row: Row, opened: Callable[[AnyEmulated], object] = lambda _emulated: None
) -> dict[str, Any]:
    """The result of a row's frame, measured again; ``opened`` is called with the device."""
    block: FrameBlock = next(each for each in folder.plan.blocks() if each.number == row.block)
    results = measured(block, frames_of(block, row.seed), row.seed, opened=opened)
    found: dict[str, Any] = next(islice(results, row.after, None)).as_dict()
    return found


def default_folder(path: Path) -> Path:
    return Path(f"{path.stem}.campaign")
