from pathlib import Path

import pyarrow.parquet
import pytest

from cubestack.host.studies.campaign.folder import PARQUET_FILE, Folder, run, write_parquet
from cubestack.host.studies.campaign.plan import CampaignPlan


def test_each_value_has_a_column(failing: set[float], plan: CampaignPlan, tmp_path: Path) -> None:
    failing.add(0.9)
    folder = Folder.begun(tmp_path / "c", plan, resume=False)
    rows = list(run(folder, 1))
    assert {row.outcome for row in rows} > {"failed", "right"}
    found = pyarrow.parquet.read_table(write_parquet(folder)).to_pylist()
    assert [(one["block"], one["row"], one["outcome"], one["reason"]) for one in found] == [
        (row.block, row.row, row.outcome, row.reason) for row in folder.rows()
    ]
    assert [one["result.drawn"] for one in found] == [
        row.result.get("drawn") for row in folder.rows()
    ]
    assert {one["swept.false_stars"] for one in found} == {0, 9}


def test_rejects_a_campaign_without_rows(plan: CampaignPlan, tmp_path: Path) -> None:
    folder = Folder.begun(tmp_path / "c", plan, resume=False)
    with pytest.raises(ValueError, match="has no rows yet"):
        write_parquet(folder)
    assert not (folder.path / PARQUET_FILE).exists()
