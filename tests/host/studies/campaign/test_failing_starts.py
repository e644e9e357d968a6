"""A campaign's folder stays as it was after any start that fails."""

from pathlib import Path

import pytest

from cubestack.host.studies.campaign.block import Row
from cubestack.host.studies.campaign.folder import Folder
from cubestack.host.studies.campaign.plan import CampaignPlan
from tests.conftest import Run
from tests.host.cli.failing_starts import digests

WRONG_PLANS = {
    "other.toml": 'device = "cubestar"\nframes = 2\n',
    "newer.toml": 'version = 9\ndevice = "cubestar"\nframes = 1\n',
    "key.toml": 'device = "cubestar"\nframes = 1\ncolour = 1\n',
    "device.toml": 'device = "nobody"\nframes = 1\n',
    "frames.toml": 'device = "cubestar"\nframes = 0\n',
    "option.toml": 'device = "cubestar"\nframes = 1\noptions.colour = 1\n',
    "grid.toml": 'device = "cubestar"\nframes = 1\ngrid.false_stars = []\n',
    "random.toml": 'device = "cubestar"\nframes = 1\nrandom.false_stars = 1\n',
    "text.toml": "hello",
    "noise.toml": "\x00\x01",
}
FAILING = (
    ("plan.toml",),
    ("missing.toml",),
    (".",),
    ("plan.toml", "other.toml"),
    ("plan.toml", "--frobnicate"),
    ("plan.toml", "--workers", "0"),
    ("plan.toml", "--workers", "many"),
    ("plan.toml", "--compare", "c"),
    ("replay", "c", "99"),
    ("replay", "c", "first"),
    ("report", "nowhere"),
    ("report", "c", "--worst", "-1"),
    ("report", "c", "--compare", "nowhere"),
    ("parquet", "nowhere"),
    *((name, "--resume") for name in WRONG_PLANS),
)


@pytest.mark.parametrize("words", FAILING, ids=" ".join)
def test_failing_start_changes_no_folder(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    plans = WRONG_PLANS | {"plan.toml": 'device = "cubestar"\nframes = 1\n'}
    for name, text in plans.items():
        Path(name).write_text(text, "utf-8")
    begun = Folder.begun(Path("c"), CampaignPlan.read(Path("plan.toml")), resume=False)
    begun.add([Row(0, 0, 1, 0, {}, "right", "", {"error_deg": 0.1})])
    Path("c/report.html").write_text("earlier")
    before = digests(Path("c"))
    out = () if words[0] in ("replay", "report", "parquet") else ("--out", "c")
    assert run("campaign", *words, *out).code != 0
    assert digests(Path("c")) == before
