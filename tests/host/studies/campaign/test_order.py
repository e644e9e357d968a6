"""The file of rows does not tell in which order workers were done."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from cubestack.host.studies.campaign import run as running
from cubestack.host.studies.campaign.folder import ROWS, Folder
from cubestack.host.studies.campaign.plan import CampaignPlan
from cubestack.host.studies.campaign.run import run


def backwards(
    perform: Callable[[Any], Any], jobs: Sequence[Any], *_workers: object
) -> Iterator[tuple[Any, Any]]:
    """Workers of which the last one is done first."""
    yield from ((job, perform(job)) for job in reversed(jobs))


@pytest.mark.usefixtures("failing")
def test_rows_are_put_into_order(
    plan: CampaignPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = Folder.begun(tmp_path / "usual", plan, resume=False)
    list(run(usual, 1))
    monkeypatch.setattr(running, "performed", backwards)
    other = Folder.begun(tmp_path / "other", plan, resume=False)
    came = [row.key for row in run(other, 1)]
    keys = [row.key for row in other.rows()]
    assert came != keys == sorted(came)

    def told(folder: Folder) -> list[str]:
        # Wall times are all that differs.
        lines = (folder.path / ROWS).read_text("utf-8").splitlines()
        return [line.partition('"wall_ms"')[0] for line in lines]

    assert told(other) == told(usual)
    assert [row.key for row in run(other, 1)] == keys
