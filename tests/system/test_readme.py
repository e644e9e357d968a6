"""README.md is short, and its caption comes from the run that drew its picture."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

from .conftest import ROOT

README = (ROOT / "README.md").read_text("utf-8")
NUMBER = r"\d+(?:\.\d+)?"


@pytest.fixture(scope="module")
def make_hero() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_hero", ROOT / "docs" / "make_hero.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_readme_has_at_most_600_words() -> None:
    assert len(README.split()) <= 600


def test_caption_is_the_one_stored_in_the_picture(make_hero: ModuleType) -> None:
    with Image.open(make_hero.PICTURE) as picture:
        stored = picture.info["Description"]
    assert make_hero.caption_of(README) == stored, "run docs/make_hero.py"


@pytest.mark.slow
def test_a_new_run_gives_the_same_caption_but_for_its_numbers(
    make_hero: ModuleType, tmp_path: Path
) -> None:
    _, caption = make_hero.hero(tmp_path)
    stored = make_hero.caption_of(README)
    assert re.sub(NUMBER, "N", caption) == re.sub(NUMBER, "N", stored)
    measured = [[float(one) for one in re.findall(NUMBER, text)] for text in (caption, stored)]
    assert measured[0][1:4] == pytest.approx(measured[1][1:4], abs=0.01)  # RA, Dec, roll
