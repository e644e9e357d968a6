"""`cubestack catalogue aramis`: its facts, its image, and options that have no effect."""

import json
from pathlib import Path

import pytest

from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.host.cli.main import main

SMALL = ("--fov", "20", "--stars-per-field", "3", "--mag-limit", "3", "--step", "5")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_facts_and_image(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "image.bin"
    assert main(["catalogue", "aramis", *SMALL, "--json", "--output", str(output)]) == 0
    out, err = capsys.readouterr()
    facts = json.loads(out)
    database = Database.unpack(output.read_bytes())
    assert facts["stars"] == len(database.numbers)
    assert facts["triangles"] == len(database)
    assert facts["bytes"] == output.stat().st_size == sum(facts["bytes_of_parts"].values())
    assert (facts["published_stars"], facts["published_triangles"]) == (1312, 265_292)
    assert facts["star_numbers"] == "Hipparcos"
    assert err == ""
    assert len(list((tmp_path / "cache" / "cubestack").iterdir())) == 1


def test_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["catalogue", "aramis", *SMALL]) == 0
    out, err = capsys.readouterr()
    assert "published triangles  265292" in out
    assert err == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("aramis", "--pair-limit", "40"), "--pair-limit has no effect for aramis"),
        (("--fov", "20"), "--fov has no effect for cubestar"),
        (("cubestar", "--output", "x"), "--output has no effect for cubestar"),
        (("aramis", "--fov", "100"), "fov_deg must be 1 to 60, not 100.0"),
        (("aramis", "--mag-limit", "9"), "mag_limit must be 0 to 7.5, not 9.0"),
        (("aramis", "--fov", "1", "--mag-limit", "1"), "stars give no triangle"),
    ],
)
def test_wrong_calls(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: str
) -> None:
    assert main(["catalogue", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert line.startswith("cubestack catalogue: ")
    assert words in line


def test_an_image_that_can_not_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["catalogue", "aramis", *SMALL, "--output", str(tmp_path / "no" / "x")]) == 1
    assert str(tmp_path / "no" / "x") in capsys.readouterr().err
