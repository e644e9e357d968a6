import json
from pathlib import Path

import pytest

from cubestack.host.cli.main import main

TEXT = 'device = "cubestar"\nframes = 2\nseed = 4\nblock = 1\n[grid]\nfalse_stars = [0, 10]\n'


def test_run_resume_report_and_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("false.toml").write_text(TEXT, "utf-8")
    assert main(["campaign", "false.toml", "--workers", "1", "--json"]) == 0
    points = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [point["point"] for point in points] == [{"false_stars": 0}, {"false_stars": 10}]
    assert [point["of"] for point in points] == [2, 2]
    assert main(["campaign", "false.toml"]) == 2
    assert "--resume continues it" in capsys.readouterr().err
    assert main(["campaign", "false.toml", "--resume", "--workers", "1"]) == 0
    assert "right" in capsys.readouterr().out
    report = ["report", "false.campaign", "--compare", "false.campaign", "--worst", "1"]
    assert main(["campaign", *report]) == 0
    assert "wrote false.campaign/report.html and 4 figures" in capsys.readouterr().err
    rows = Path("false.campaign/rows.jsonl").read_text("utf-8").splitlines()
    assert main(["campaign", "replay", "false.campaign", "3"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again.items() >= json.loads(rows[3])["result"].items()


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["nothing.toml"], "No such file"),
        (["a.toml", "b.toml"], "one plan at a time"),
        (["report"], "report wants a campaign's folder"),
        (["a.toml", "--compare", "b"], "--compare is for a report"),
        (["replay"], "replay wants a campaign's folder and the number of a row"),
        (["parquet"], "parquet wants a campaign's folder"),
        (["replay", "nowhere", "1"], "nowhere is no campaign's folder"),
    ],
)
def test_rejects_wrong_arguments_in_one_line(
    words: list[str],
    error: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["campaign", *words]) != 0
    told = capsys.readouterr().err
    assert error in told
    assert told.count("\n") == 1
