import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.host.studies.campaign.plan import CampaignPlan, known_plans, plan_file, summary
from tests.conftest import Run

PAGE = Path(__file__).parents[4] / "docs" / "how-to" / "campaigns.md"

TEXT = """
device = "cubestar"
frames = 100
seed = 1
block = 25
[options]
profile = "extended"
[grid]
false_stars = [0, 5, 10]
hazard = [[], ["moon"]]
[random]
mag_limit = { low = 3.5, high = 6.0 }
mode = { of = ["lis", "assisted"] }
"""


def write(path: Path, text: str = TEXT) -> Path:
    path.write_text(text, "utf-8")
    return path


def test_paths_of_gateware_start_at_the_plan(tmp_path: Path) -> None:
    for name in ("sun.v", "nadir.v"):
        (tmp_path / name).touch()
    designs = {
        "sun=sun.v:top,nadir=nadir.v": f"sun={tmp_path}/sun.v:top,nadir={tmp_path}/nadir.v",
        "sun.v,nadir.v:top": f"{tmp_path}/sun.v,{tmp_path}/nadir.v:top",
        f"{tmp_path}/sun.v": f"{tmp_path}/sun.v",
        "design:Class": "design:Class",
        "corrected": "corrected",
    }
    grid = f'device = "cubesense"\nframes = 1\n[grid]\ngateware = {json.dumps([*designs])}\n'
    plan = CampaignPlan.read(write(tmp_path / "a.toml", grid))
    assert plan.grid["gateware"] == [*designs.values()]


def test_campaign_has_a_point_for_every_combination(tmp_path: Path) -> None:
    plan = CampaignPlan.read(write(tmp_path / "a.toml"))
    assert len(plan.points) == 6
    blocks = list(plan.blocks())
    assert [block.number for block in blocks] == list(range(24))
    assert sum(block.frames for block in blocks) == 600
    assert all(block.options["profile"] == "extended" for block in blocks)
    assert {block.swept["mode"] for block in blocks} == {"lis", "assisted"}
    limits = {block.swept["mag_limit"] for block in blocks}
    assert len(limits) == 4
    assert all(3.5 <= limit <= 6 for limit in limits)


def test_all_points_have_the_same_skies(tmp_path: Path) -> None:
    plan = CampaignPlan.read(write(tmp_path / "a.toml"))
    seen: dict[Any, list[Any]] = {}
    for block in plan.blocks():
        point = block.swept["false_stars"], tuple(block.swept["hazard"])
        seen.setdefault(point, []).append((block.seed, block.swept["mag_limit"]))
    first, *others = seen.values()
    assert all(other == first for other in others)
    assert len(set(first)) == len(first)


def test_seed_defaults_to_0() -> None:
    plans = [
        CampaignPlan(device="cubestar", frames=3, block=1, **seed)
        for seed in ({}, {"seed": 0}, {"seed": 1})
    ]
    untold, zero, one = ([block.seed for block in plan.blocks()] for plan in plans)
    assert untold == zero != one


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 200), st.integers(1, 40))
def test_campaign_blocks_cover_all_frames(frames: int, size: int) -> None:
    blocks = list(CampaignPlan(device="cubestar", frames=frames, block=size).blocks())
    assert sum(block.frames for block in blocks) == frames
    assert max(block.frames for block in blocks) == min(size, frames)
    assert len({block.seed for block in blocks}) == len(blocks)


def test_paths_are_relative_to_the_plan(tmp_path: Path) -> None:
    write(tmp_path / "a.toml", 'device = "cubestar"\nframes = 1\n[grid]\nscene = ["x.toml"]\n')
    (block,) = CampaignPlan.read(tmp_path / "a.toml").blocks()
    assert block.options == {"scene": str(tmp_path / "x.toml")}


HEAD = 'device = "cubestar"\nframes = 1\n'


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ('device = "cubestar"', "frames is missing"),
        ("frames = 1", "device is missing"),
        ('device = "nobody"\nframes = 1', "no device 'nobody'; known: cubestar"),
        ('device = "cubestar"\nframes = 0', "frames must be 1 to 100000000, not 0"),
        ('device = "cubestar"\nframe = 1', "no key 'frame' here; known: device, frames"),
        (HEAD + "[grid]\nfalse_star = [1]", "no option 'false_star'"),
        (HEAD + "[grid]\nfalse_stars = [1, -2]", "false_stars = -2"),
        (HEAD + "[grid]\nfalse_stars = 3", "must be a list of values"),
        (HEAD + "[grid]\nseed = [1]", "seed belongs at the top"),
        (HEAD + "[random]\nmag_limit = 3", "random.mag_limit must be"),
        (HEAD + "[random]\nmag_limit = { low = 6, high = 3 }", "random.mag_limit must be"),
        (HEAD + '[options]\nmode = "lis"\n[grid]\nmode = ["lis"]', "mode is given in two"),
        ("device = ", "Invalid value"),
    ],
)
def test_rejects_invalid_plans(tmp_path: Path, text: str, error: str) -> None:
    with pytest.raises(ValueError, match=error) as caught:
        CampaignPlan.read(write(tmp_path / "a.toml", text))
    assert str(caught.value).startswith(f"{tmp_path / 'a.toml'}: ")
    assert "\n" not in str(caught.value)


def test_plan_of_the_page_is_valid(tmp_path: Path) -> None:
    page = PAGE.read_text("utf-8")
    plan = CampaignPlan.read(write(tmp_path / "a.toml", page.split("```toml\n")[1].split("```")[0]))
    assert (plan.frames, len(plan.points)) == (1000, 8)


@pytest.mark.parametrize("name", known_plans())
def test_shipped_plan_is_valid_and_documented(name: str) -> None:
    path = plan_file(name)
    assert CampaignPlan.read(path).points
    assert len(summary(path)) > 20
    assert f"`{name}`" in PAGE.read_text("utf-8")


def test_plan_name_prefers_a_file_and_must_exist(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=r"'seu-cubstar': give a .toml file, or .*seu-cubestar"):
        plan_file("seu-cubstar")
    (tmp_path / "seu-cubestar").write_text("", "utf-8")
    assert plan_file("seu-cubestar") == Path("seu-cubestar")


PLAN_TEXT = 'device = "cubestar"\nframes = 2\nseed = 4\nblock = 1\n[grid]\nfalse_stars = [0, 10]\n'


def test_run_resume_report_and_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("false.toml").write_text(PLAN_TEXT.replace("block = 1", "block = 2"), "utf-8")
    lines = run("campaign", "false.toml", "--workers", "1", "--json").out.splitlines()
    points = [json.loads(line) for line in lines]
    assert [point["point"] for point in points] == [{"false_stars": 0}, {"false_stars": 10}]
    assert [point["of"] for point in points] == [2, 2]
    assert "--resume continues it" in run("campaign", "false.toml").line
    assert "right" in run("campaign", "false.toml", "--resume", "--workers", "1").out
    report = ("report", "false.campaign", "--compare", "false.campaign", "--worst", "1")
    assert "wrote false.campaign/report.html and 4 figures" in run("campaign", *report).err
    rows = Path("false.campaign/rows.jsonl").read_text("utf-8").splitlines()
    again = json.loads(run("campaign", "replay", "false.campaign", "3").out)
    assert again.items() >= json.loads(rows[3])["result"].items()
