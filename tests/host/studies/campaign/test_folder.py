import errno
import json
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest

from cubestack.host.studies.campaign.block import Row
from cubestack.host.studies.campaign.folder import (
    PARQUET_FILE,
    PLAN,
    ROWS,
    Folder,
    FolderError,
    run,
    write_parquet,
)
from cubestack.host.studies.campaign.plan import CampaignPlan


def rows(block: int, count: int = 3) -> list[Row]:
    return [Row(block, row, 1, row, {}, "right", "", {"x": 0.1}) for row in range(count)]


def test_rows_are_read_as_written_and_sorted(folder: Folder) -> None:
    folder.add(rows(1))
    folder.add(rows(0))
    assert list(Folder(folder.path).rows()) == rows(1) + rows(0)
    folder.sort()
    assert list(folder.rows()) == rows(0) + rows(1)


def test_sorting_keeps_one_block_in_memory(folder: Folder) -> None:
    blocks, many = [*range(1, 60, 2), *range(0, 60, 2)], {str(n): n / 3 for n in range(200)}
    for block in blocks:
        folder.add(replace(row, result=many) for row in rows(block))
    before = (folder.path / ROWS).stat().st_size
    tracemalloc.start()
    folder.sort()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert [row.key for row in folder.rows()] == [(n, row) for n in range(60) for row in range(3)]
    assert (folder.path / ROWS).stat().st_size == before
    assert peak < before / 4


@pytest.mark.parametrize("cut", range(1, 200, 13))
def test_repair_removes_only_a_torn_block(folder: Folder, cut: int) -> None:
    folder.add(rows(2))
    folder.add(rows(1))
    path = folder.path / ROWS
    path.write_bytes(path.read_bytes()[:-cut])
    assert folder.repair(dict.fromkeys(range(6), 3)) == {2}
    assert list(folder.rows()) == rows(2)


def test_resume_needs_the_same_plan(tmp_path: Path, plan: CampaignPlan) -> None:
    Folder.begun(tmp_path / "c", plan, resume=True)
    assert Folder.begun(tmp_path / "c", plan, resume=True).plan == plan
    with pytest.raises(FolderError, match="already has a campaign; --resume continues"):
        Folder.begun(tmp_path / "c", plan, resume=False)
    other = CampaignPlan(device="cubestar", frames=8, seed=6, block=3, grid={"false_stars": [0, 9]})
    with pytest.raises(FolderError, match="another plan, with other frames, seed"):
        Folder.begun(tmp_path / "c", other, resume=True)


def test_resume_rejects_another_version(folder: Folder) -> None:
    path = folder.path / PLAN
    path.write_text(json.dumps(json.loads(path.read_text()) | {"version": "0.0.1"}))
    with pytest.raises(FolderError, match=r"begun by cubestack 0\.0\.1, and this is"):
        Folder.begun(folder.path, folder.plan, resume=True)


@pytest.mark.parametrize(
    ("told", "error"),
    [
        (None, "is no campaign's folder: it has no campaign.json"),
        ("{", "campaign.json: "),
        ('{"plan": {}, "version": "1"}', "campaign.json: "),
    ],
)
def test_rejects_a_folder_that_is_no_campaign(tmp_path: Path, told: str | None, error: str) -> None:
    if told is not None:
        (tmp_path / PLAN).write_text(told)
    with pytest.raises(FolderError, match=error):
        Folder(tmp_path)


def test_rejects_a_folder_with_other_files(tmp_path: Path, plan: CampaignPlan) -> None:
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(FolderError, match="is not empty and has no campaign"):
        Folder.begun(tmp_path, plan, resume=True)


def test_campaign_is_locked_by_one_process(folder: Folder) -> None:
    with (
        folder.alone(),
        pytest.raises(FolderError, match="another process works on this campaign"),
        Folder(folder.path).alone(),
    ):
        pass


def test_full_disk_names_the_file(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.add(rows(0))

    def full(_fileno: int) -> Any:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match=r"No space left on device.*rows\.jsonl"):
        folder.add(rows(1))
    assert list(folder.rows())[:3] == rows(0)


def test_each_value_has_a_column(folder: Folder, failing: set[float]) -> None:
    failing.add(0.9)
    rows = list(run(folder, 1))
    assert {row.outcome for row in rows} > {"failed", "right"}
    found = pyarrow.parquet.read_table(write_parquet(folder)).to_pylist()
    assert [(one["block"], one["row"], one["outcome"], one["reason"]) for one in found] == [
        (row.block, row.row, row.outcome, row.reason) for row in folder.rows()
    ]
    drawn = [row.result.get("drawn") for row in folder.rows()]
    assert [one["result.drawn"] for one in found] == drawn
    assert {one["swept.false_stars"] for one in found} == {0, 9}


def test_rejects_a_campaign_without_rows(folder: Folder) -> None:
    with pytest.raises(ValueError, match="has no rows yet"):
        write_parquet(folder)
    assert not (folder.path / PARQUET_FILE).exists()
