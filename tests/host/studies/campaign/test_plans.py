"""Plans that come with the devices can be run, and say what they are for."""

from pathlib import Path

import pytest

from cubestack.host.studies.campaign.plan import CampaignPlan
from cubestack.host.studies.campaign.plans import known_plans, plan_file, summary

ROOT = Path(__file__).parents[4]


@pytest.mark.parametrize("name", known_plans())
def test_it_is_read_and_told(name: str) -> None:
    path = plan_file(name)
    assert CampaignPlan.read(path).points
    assert len(summary(path)) > 20
    assert f"`{name}`" in (ROOT / "docs" / "campaigns.md").read_text("utf-8")


def test_a_file_goes_before_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "seu-cubestar").write_text("", "utf-8")
    assert plan_file("seu-cubestar") == Path("seu-cubestar")


def test_a_name_that_there_is_not_is_told() -> None:
    with pytest.raises(ValueError, match=r"'seu-cubstar': give a .toml file, or .*seu-cubestar"):
        plan_file("seu-cubstar")
