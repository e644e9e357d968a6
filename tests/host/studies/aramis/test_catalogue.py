import json
from pathlib import Path

import pytest

from cubestack.firmware_model.aramis.catalogue.database import Database

from ....conftest import Run

SMALL = ("--fov", "20", "--stars-per-field", "3", "--mag-limit", "3", "--step", "5")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_facts_and_image(tmp_path: Path, run: Run) -> None:
    output = tmp_path / "image.bin"
    code, out, err = run("catalogue", "aramis", *SMALL, "--json", "--output", output)
    assert (code, err) == (0, "")
    facts = json.loads(out)
    database = Database.unpack(output.read_bytes())
    assert facts["stars"] == len(database.numbers)
    assert facts["triangles"] == len(database)
    assert facts["bytes"] == output.stat().st_size == sum(facts["bytes_of_parts"].values())
    assert (facts["published_stars"], facts["published_triangles"]) == (1312, 265_292)
    assert facts["star_numbers"] == "Hipparcos"
    assert len(list((tmp_path / "cache" / "cubestack").iterdir())) == 1


def test_text_output(run: Run) -> None:
    code, out, err = run("catalogue", "aramis", *SMALL)
    assert (code, err) == (0, "")
    assert "published triangles  265292" in out


def test_names_an_output_that_cannot_be_written(tmp_path: Path, run: Run) -> None:
    outcome = run("catalogue", "aramis", *SMALL, "--output", tmp_path / "no" / "x")
    assert (outcome.code, str(tmp_path / "no" / "x") in outcome.line) == (1, True)
