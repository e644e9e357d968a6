import gc
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.host.studies.campaign import block as blocks
from cubestack.host.studies.campaign import folder as running
from cubestack.host.studies.campaign.block import perform, rows_of
from cubestack.host.studies.campaign.folder import PLAN, ROWS, Folder, count, replayed, run
from cubestack.host.studies.campaign.plan import CampaignPlan, FrameBlock
from cubestack.host.studies.campaign.statistics import rates
from tests.tiers import quick_ones

from ..test_workers import dask_cluster
from .test_plan import PLAN_TEXT


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "small.toml"
    path.write_text(PLAN_TEXT, "utf-8")
    return path


@pytest.fixture(scope="module")
def alone(small: Path, tmp_path_factory: pytest.TempPathFactory) -> Folder:
    path = tmp_path_factory.mktemp("c") / "alone"
    folder = Folder.begun(path, CampaignPlan.read(small), resume=False)
    rows = list(run(folder, 1))
    assert len(rows) == count(folder.plan) == 4
    return folder


def content(folder: Path) -> bytes:
    return (folder / ROWS).read_bytes()


@pytest.mark.slow
def test_two_workers_write_the_same_file(alone: Folder, tmp_path: Path) -> None:
    folder = Folder.begun(tmp_path / "two", alone.plan, resume=False)
    assert len(list(run(folder, 2))) == 4
    assert content(folder.path) == content(alone.path)


@pytest.mark.slow
def test_cluster_writes_the_same_results_as_one_process(alone: Folder, tmp_path: Path) -> None:
    folder = Folder.begun(tmp_path / "cluster", alone.plan, resume=False)
    with dask_cluster() as cluster:
        list(run(folder, 1, cluster.scheduler_address))
    assert content(folder.path) == content(alone.path)


@pytest.mark.slow
def test_kill_loses_only_blocks_in_progress(alone: Folder, small: Path, tmp_path: Path) -> None:
    out, generator = tmp_path / "killed", np.random.default_rng(8)
    call = [sys.executable, "-m", "cubestack.host.cli.main", "campaign", str(small)]
    call += ["--out", str(out), "--resume", "--workers", "2", "--json"]
    before = b""
    for _ in range(3):
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
def test_replay_reproduces_a_row(alone: Folder, number: int) -> None:
    row = list(alone.rows())[number]
    assert blocks._plain(replayed(alone, number)) == row.result
    with pytest.raises(ValueError, match="has rows 0 to 3, not 4"):
        replayed(alone, 4)


@pytest.mark.slow
def test_rates_are_counted_by_point(alone: Folder) -> None:
    found = rates(alone)
    assert list(found) == [(("false_stars", 0),), (("false_stars", 10),)]
    assert all(ended.total() == 2 for ended in found.values())
    assert found[(("false_stars", 0),)]["right"] == 2


def test_resume_does_not_measure_existing_rows(folder: Folder, failing: set[float]) -> None:
    rows: Iterator[object] = run(folder, 1)
    for _ in range(4):
        next(rows)
    rows.close()  # type: ignore[attr-defined]
    done = content(folder.path)
    failing.add(-1.0)  # from here on all fail
    list(run(Folder(folder.path), 1))
    assert set(done.splitlines()) <= set(content(folder.path).splitlines())
    ended = [row.outcome for row in folder.rows()]
    assert len(ended) == 14
    assert ended[:3] != ["failed"] * 3
    assert ended[-3:] == ["failed"] * 3


def test_no_rows_are_written_if_every_frame_fails(folder: Folder, failing: set[float]) -> None:
    failing.add(-1.0)
    with pytest.raises(RuntimeError, match="nothing can be measured: IndexError: drawn"):
        list(run(folder, 1))
    assert (folder.path / PLAN).is_file()
    assert not list(folder.rows())


@pytest.mark.usefixtures("failing")
def test_rows_are_sorted_whichever_worker_ends_first(
    folder: Folder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def performed_backwards(perform: Any, jobs: Any, *_workers: object) -> Iterator[Any]:
        yield from ((job, perform(job)) for job in reversed(jobs))

    def lines(folder: Folder) -> list[str]:  # wall times differ
        text = content(folder.path).decode()
        return [line.partition('"wall_ms"')[0] for line in text.splitlines()]

    list(run(folder, 1))
    monkeypatch.setattr(running, "performed", performed_backwards)
    other = Folder.begun(tmp_path / "other", folder.plan, resume=False)
    completed = [row.key for row in run(other, 1)]
    keys = [row.key for row in other.rows()]
    assert completed != keys == sorted(completed)
    assert lines(other) == lines(folder)
    assert [row.key for row in run(other, 1)] == keys


def of(frames: int, device: str = "cubestar") -> FrameBlock:
    return FrameBlock(4, device, {"false_stars": 2}, {"false_stars": 2}, frames, 77)


@pytest.mark.usefixtures("failing")
def test_rows_have_the_outcome_of_each_frame() -> None:
    rows = perform(of(40))
    assert [row.key for row in rows] == [(4, number) for number in range(40)]
    for row in rows:
        drawn = row.result["drawn"]
        assert row.outcome == ("right" if drawn > 0.3 else "wrong" if drawn > 0.2 else "refused")
        assert row.reason == ("dark" if row.outcome == "refused" else "")
    assert len({row.outcome for row in rows}) == 3


@pytest.mark.usefixtures("failing")
def test_rows_contain_no_durations() -> None:
    assert perform(of(5)) == perform(of(5))


def test_failed_frame_is_a_row_and_others_are_measured(failing: set[float]) -> None:
    failing.add(0.8)
    rows = perform(of(40))
    assert [row.row for row in rows] == list(range(40))
    failed = [row for row in rows if row.outcome == "failed"]
    assert 2 < len(failed) < 20
    assert all(row.reason.startswith("IndexError: drawn 0.") for row in failed)
    assert all(row.result["drawn"] <= 0.8 for row in rows if row.outcome != "failed")
    # Its seed and its place give the same again.
    for row in rows:
        results = blocks.measure("cubestar", frames=40, seed=row.seed, false_stars=2)
        again = list(blocks._measured(of(40), results, 0, row.seed, 1))[row.after]
        assert (again.outcome, again.reason, again.result) == (row.outcome, row.reason, row.result)


def test_frame_of_two_cameras_has_two_rows() -> None:
    assert rows_of(FrameBlock(0, "cubesense", {}, {}, 5, 1)) == 10
    assert rows_of(FrameBlock(0, "cubesense", {"sensor": "sun"}, {}, 5, 1)) == 5


def devices() -> int:
    """Number of kernels, each of a device that is in memory."""
    return sum(type(one) is Kernel for one in gc.get_objects())


@pytest.mark.parametrize("profile", quick_ones(["published", "extended"], "extended"))
def test_block_runs_on_an_emulated_device_and_leaves_none(profile: str) -> None:
    gc.collect()
    before = devices()
    plan = CampaignPlan(device="cubestar", frames=2, seed=3, options={"profile": profile})
    rows = perform(*plan.blocks())
    assert [row.outcome for row in rows] == ["right", "right"]
    assert "wall_ms" not in rows[0].result
    assert devices() == before
