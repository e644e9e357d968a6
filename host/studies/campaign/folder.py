"""A campaign's folder, and runs into it: a plan and a row per result survive any interruption.

The rows of a finished block are appended together. Resuming removes incomplete blocks. A complete
campaign is sorted, so that its file does not depend on the number of workers. A Parquet file of its
rows is for pandas, polars, DuckDB and their like.
"""

import fcntl
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any

from cubestack.firmware_model.formats import untrusted
from cubestack.firmware_model.formats.untrusted import parse_json, read_json, read_lines
from cubestack.firmware_model.versions import CAMPAIGN
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.export.parquet import arrow as pyarrow
from cubestack.host.output import write_output
from cubestack.host.studies.campaign.block import Row, frames_of, measured, perform, rows_of
from cubestack.host.studies.campaign.plan import CampaignPlan, FrameBlock
from cubestack.host.studies.workers import performed

PLAN, ROWS = "campaign.json", "rows.jsonl"


LARGEST_ROWS = 64 << 30
"""Bytes of the rows of a campaign, which are read line by line."""

KINDS = {
    **dict.fromkeys(("block", "row", "seed", "after"), int),
    "swept": dict,
    **dict.fromkeys(("outcome", "reason"), str),
    "result": dict,
}
"""Type of each member of a row."""


class FolderError(ValueError):
    """The folder does not belong to this campaign."""


class Folder:
    """The folder of a campaign.

    Attributes:
        path: of it.
        plan: of the campaign.
        version: of the program that began it.
    """

    def __init__(self, path: Path) -> None:
        """Open an existing folder; raises FolderError if it has no campaign."""
        self.path = path
        try:
            told = read_json(path / PLAN)
            CAMPAIGN.check(told.get("format"))
            self.plan, self.version = CampaignPlan(**told["plan"]), str(told["version"])
        except FileNotFoundError:
            raise FolderError(f"{path} is no campaign's folder: it has no {PLAN}") from None
        except (OSError, AttributeError, KeyError, TypeError, ValueError) as error:
            raise FolderError(f"{path / PLAN}: {error}") from None

    @classmethod
    def begun(cls, path: Path, plan: CampaignPlan, *, resume: bool) -> "Folder":
        """The folder for a plan: a new one or, to ``resume``, its existing one.

        Raises:
            FolderError: it has results and is not to be resumed, or they are of another plan or of
                another version of the program.
            OSError: it can not be made.
        """
        path.mkdir(parents=True, exist_ok=True)
        if not (path / PLAN).is_file():
            if any(path.iterdir()):
                raise FolderError(f"{path} is not empty and has no campaign; choose another folder")
            told = {
                "format": CAMPAIGN.current,
                "version": version("cubestack"),
                "plan": plan.as_dict(),
            }
            _replace(path / PLAN, [json.dumps(told, indent=1) + "\n"])
            return cls(path)
        found = cls(path)
        if not resume:
            raise FolderError(f"{path} already has a campaign; --resume continues it")
        if found.version != version("cubestack"):
            raise FolderError(
                f"{path} was begun by cubestack {found.version}, and this is {version('cubestack')}"
            )
        if found.plan.as_dict() != plan.as_dict():
            changed = [
                key for key, value in plan.as_dict().items() if vars(found.plan)[key] != value
            ]
            raise FolderError(f"{path} has another plan, with other {', '.join(changed)}")
        return found

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Lock the folder; raises FolderError if another process has it."""
        with (self.path / PLAN).open() as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise FolderError(f"{self.path}: another process works on this campaign") from None
            yield

    def rows(self) -> Iterator[Row]:
        """All rows so far, without a torn last line; FolderError names a damaged one."""
        return (row for row, _ in self._lines())

    def _lines(self) -> Iterator[tuple[Row, bytes]]:
        path = self.path / ROWS
        try:
            for number, line in read_lines(path, LARGEST_ROWS, FolderError):
                if line.endswith(b"\n"):
                    where = f"{path}, line {number}"
                    yield _row(parse_json(line, where, FolderError, finite=False), where), line
        except FileNotFoundError:
            return

    def repair(self, rows_of: Mapping[int, int]) -> set[int]:
        """Remove incomplete blocks; returns the numbers of the others."""
        found: dict[int, int] = {}
        for row in self.rows():
            found[row.block] = found.get(row.block, 0) + 1
        whole = {block for block, count in found.items() if count == rows_of.get(block)}
        kept = (row for row in self.rows() if row.block in whole)
        _replace(self.path / ROWS, map(_line, kept))
        return whole

    def add(self, rows: Iterable[Row]) -> None:
        """Append the rows of a block; raises OSError with the file's name if the disk is full."""
        path = self.path / ROWS
        try:
            with path.open("a", encoding="utf-8") as file:
                file.write("".join(map(_line, rows)))
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from None

    def sort(self) -> None:
        """Order the rows by block. Only one block is in memory."""
        spans, end = list[tuple[tuple[int, int], int, int]](), 0
        for row, line in self._lines():
            if not spans or spans[-1][0][0] != row.block:
                spans.append((row.key, end, end))
            end += len(line)
            spans[-1] = (*spans[-1][:2], end)
        _replace(self.path / ROWS, _texts(self.path / ROWS, sorted(spans)))


def _texts(path: Path, spans: Iterable[tuple[object, int, int]]) -> Iterator[str]:
    """The text from each place of a file to another one."""
    with untrusted.opened(path, LARGEST_ROWS, FolderError) as file:
        for _, begin, end in spans:
            file.seek(begin)
            yield file.read(end - begin).decode()


def _row(content: Any, where: str) -> Row:
    if not isinstance(content, dict) or content.keys() != KINDS.keys():
        raise FolderError(f"{where}: a row has {', '.join(KINDS)}")
    for name, kind in KINDS.items():
        if type(content[name]) is not kind:
            raise FolderError(f"{where}: {name} must be {kind.__name__}, not {content[name]!r}")
    return Row(**content)


def _line(row: Row) -> str:
    return json.dumps(vars(row)) + "\n"


def _replace(path: Path, lines: Iterable[str]) -> None:
    new = path.with_suffix(".new")
    with new.open("w", encoding="utf-8") as file:
        file.writelines(lines)
        file.flush()
        os.fsync(file.fileno())
    new.replace(path)


PARQUET_FILE = "rows.parquet"


def write_parquet(folder: Folder) -> Path:
    """Write the rows so far, a column per value; returns the file.

    Columns are the attributes of ``Row``; a swept option is ``swept.NAME``, a value of the result
    ``result.NAME``.

    Replaces an earlier one. Raises ValueError without rows, and without pyarrow.
    """
    arrow = pyarrow()
    table = arrow.Table.from_pylist([vars(row) for row in folder.rows()])
    if not table.num_rows:
        raise ValueError(f"{folder.path} has no rows yet")
    for nested in ("swept", "result"):
        at = table.schema.get_field_index(nested)
        fields = table.column(at).combine_chunks()
        table = table.remove_column(at)
        for name, column in zip((one.name for one in fields.type), fields.flatten(), strict=True):
            table = table.append_column(f"{nested}.{name}", column)
    whole = BytesIO()
    arrow.parquet.write_table(table, whole)
    write_output(folder.path / PARQUET_FILE, whole.getvalue())
    return folder.path / PARQUET_FILE


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
