"""Campaigns of real devices: the same rows however many workers, kills or clusters."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cubestack.host.studies.campaign import block as blocks
from cubestack.host.studies.campaign.folder import PLAN, ROWS, Folder
from cubestack.host.studies.campaign.plan import CampaignPlan
from cubestack.host.studies.campaign.run import count, replayed, run
from cubestack.host.studies.campaign.statistics import rates

from ..cluster import dask_cluster

TEXT = 'device = "cubestar"\nframes = 2\nseed = 4\nblock = 1\n[grid]\nfalse_stars = [0, 10]\n'


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "small.toml"
    path.write_text(TEXT, "utf-8")
    return path


@pytest.fixture(scope="module")
def alone(small: Path, tmp_path_factory: pytest.TempPathFactory) -> Folder:
    """What one worker makes of it."""
    folder = Folder.begun(
        tmp_path_factory.mktemp("c") / "alone", CampaignPlan.read(small), resume=False
    )
    rows = list(run(folder, 1))
    assert len(rows) == count(folder.plan) == 4
    return folder


def content(folder: Path) -> bytes:
    return (folder / ROWS).read_bytes()


@pytest.mark.slow
def test_two_workers_make_the_same_file(alone: Folder, tmp_path: Path) -> None:
    folder = Folder.begun(tmp_path / "two", alone.plan, resume=False)
    assert len(list(run(folder, 2))) == 4
    assert content(folder.path) == content(alone.path)


@pytest.mark.slow
def test_a_cluster_makes_the_same_file(alone: Folder, tmp_path: Path) -> None:
    folder = Folder.begun(tmp_path / "cluster", alone.plan, resume=False)
    with dask_cluster() as cluster:
        list(run(folder, 1, cluster.scheduler_address))
    assert content(folder.path) == content(alone.path)


@pytest.mark.slow
@pytest.mark.parametrize("kills", [1, 3])
def test_kills_lose_only_blocks_in_flight(
    alone: Folder, small: Path, tmp_path: Path, kills: int
) -> None:
    out, generator = tmp_path / "killed", np.random.default_rng(8)
    call = [sys.executable, "-m", "cubestack.host.cli.main", "campaign", str(small)]
    call += ["--out", str(out), "--resume", "--workers", "2", "--json"]
    before = b""
    for _ in range(kills):
        with subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
            try:
                process.wait(float(generator.uniform(1.0, 4.0)))
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
        now = content(out) if (out / ROWS).is_file() else b""
        assert set(before.splitlines()) <= set(now.splitlines())
        before = now
    subprocess.run(call, check=True, capture_output=True)
    assert content(out) == content(alone.path)


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 0])
def test_a_row_is_replayed(alone: Folder, number: int) -> None:
    row = list(alone.rows())[number]
    again = replayed(alone, number)
    assert blocks._plain(again) == row.result


@pytest.mark.slow
def test_what_cannot_be_replayed_is_told(alone: Folder) -> None:
    with pytest.raises(ValueError, match="has rows 0 to 3, not 4"):
        replayed(alone, 4)


@pytest.mark.slow
def test_rates_are_counted_by_point(alone: Folder) -> None:
    found = rates(alone)
    assert list(found) == [(("false_stars", 0),), (("false_stars", 10),)]
    assert all(ended.total() == 2 for ended in found.values())
    assert found[(("false_stars", 0),)]["right"] == 2


def test_what_is_there_is_not_measured_again(
    failing: set[float], plan: CampaignPlan, tmp_path: Path
) -> None:
    folder = Folder.begun(tmp_path / "c", plan, resume=False)
    rows: Iterator[object] = run(folder, 1)
    for _ in range(4):
        next(rows)
    rows.close()  # type: ignore[attr-defined]
    done = content(folder.path)
    failing.add(-1.0)  # from here on all fail
    list(run(Folder(folder.path), 1))
    assert set(done.splitlines()) <= set(content(folder.path).splitlines())
    ended = [row.outcome for row in folder.rows()]
    assert ended[:3] != ["failed"] * 3
    assert ended[-3:] == ["failed"] * 3


def test_where_everything_fails_nothing_is_kept(
    failing: set[float], plan: CampaignPlan, tmp_path: Path
) -> None:
    failing.add(-1.0)
    folder = Folder.begun(tmp_path / "c", plan, resume=False)
    with pytest.raises(RuntimeError, match="nothing can be measured: IndexError: drawn"):
        list(run(folder, 1))
    assert (folder.path / PLAN).is_file()
    assert not list(folder.rows())
