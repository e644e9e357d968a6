import pytest

from cubestack.host.studies.campaign import block as blocks
from cubestack.host.studies.campaign.block import perform, rows_of
from cubestack.host.studies.campaign.plan import CampaignPlan, FrameBlock


def of(frames: int, device: str = "cubestar") -> FrameBlock:
    return FrameBlock(4, device, {"false_stars": 2}, {"false_stars": 2}, frames, 77)


def test_rows_have_the_outcome_of_each_frame(failing: set[float]) -> None:
    assert not failing
    rows = perform(of(40))
    assert [row.key for row in rows] == [(4, number) for number in range(40)]
    for row in rows:
        drawn = row.result["drawn"]
        assert row.outcome == ("right" if drawn > 0.3 else "wrong" if drawn > 0.2 else "refused")
        assert row.reason == ("dark" if row.outcome == "refused" else "")
    assert len({row.outcome for row in rows}) == 3


def test_rows_contain_no_durations(failing: set[float]) -> None:
    assert not failing
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
        again = list(blocks._measured(of(40), _results(row.seed), 0, row.seed, 1))[row.after]
        assert (again.outcome, again.reason, again.result) == (row.outcome, row.reason, row.result)


def _results(seed: int):  # type: ignore[no-untyped-def]
    return blocks.measure("cubestar", frames=40, seed=seed, false_stars=2)


def test_frame_of_two_cameras_has_two_rows() -> None:
    assert rows_of(FrameBlock(0, "cubesense", {}, {}, 5, 1)) == 10
    assert rows_of(FrameBlock(0, "cubesense", {"sensor": "sun"}, {}, 5, 1)) == 5


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_block_of_a_real_device(profile: str) -> None:
    (one,) = CampaignPlan(
        device="cubestar", frames=2, seed=3, options={"profile": profile}
    ).blocks()
    rows = perform(one)
    assert [row.outcome for row in rows] == ["right", "right"]
    assert "wall_ms" not in rows[0].result
