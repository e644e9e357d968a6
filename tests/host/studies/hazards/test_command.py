import json
from pathlib import Path

import pytest
from PIL import Image

from cubestack.host.cli.main import main


def test_out_writes_pictures_curves_and_points(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--hazard", "gradient", "--frames", "1", "--workers", "1", "--out", str(tmp_path)]
    assert main(["hazards", "cubestar", *arguments, "--json"]) == 0
    printed = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    pictures = tmp_path / "images" / "hazards"
    lines = (pictures / "points.jsonl").read_text("utf-8").splitlines()
    assert [json.loads(line) for line in lines] == printed
    assert {point["strength"] for point in printed} >= {0, 60}
    with Image.open(pictures / "gradient-cubestar.jpg") as sample:
        assert sample.size == (480, 240)
    with Image.open(pictures / "gradient-curve.png") as curve:
        assert curve.width > 300
    page = (tmp_path / "hazards.md").read_text("utf-8")
    assert "## gradient" in page
    assert "| CubeStar | 60 | " in page


def test_rejects_a_page_without_markers_and_a_file_as_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "hazards.md").write_text("mine\n", "utf-8")
    assert main(["hazards", "cubestar", "--out", str(tmp_path)]) == 2
    assert "hazards.md has no lines <!-- hazards -->" in capsys.readouterr().err
    assert main(["hazards", "cubestar", "--out", str(tmp_path / "hazards.md")]) == 2
    assert "is a file; a folder would be right" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["cubestar", "--hazard", "rain"], "cubestar has no 'rain'; known: aberration"),
        (["nobody"], "no device 'nobody'; known: cubestar"),
    ],
)
def test_rejects_unknown_hazards_and_devices(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["hazards", *arguments]) == 2
    assert message in capsys.readouterr().err
