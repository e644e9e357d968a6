import re
from pathlib import Path

import pytest
from PIL import Image

from docs.diagrams.architecture import FLOORS, architecture
from docs.make_diagrams import IMAGES, diagrams
from docs.make_hero import PICTURE, caption_of, hero
from tests.system.conftest import ROOT

SENSORS = IMAGES / "sensors"
README = (ROOT / "README.md").read_text("utf-8")
NUMBER = r"\d+(?:\.\d+)?"
STALE = "is stale: python -m docs.make_diagrams"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return diagrams(tmp_path_factory.mktemp("traces"))


def test_committed_diagrams_are_up_to_date(drawn: dict[str, str]) -> None:
    assert {path.name for path in SENSORS.glob("*.svg")} == {*drawn}
    for name, text in drawn.items():
        assert (SENSORS / name).read_text(encoding="utf-8") == text, f"{name} {STALE}"


def test_every_diagram_is_shown_on_its_page(drawn: dict[str, str]) -> None:
    for name in drawn:
        page = ROOT / "docs" / "sensors" / f"sensor-{name.split('-')[0]}.md"
        assert f"](../images/sensors/{name})" in page.read_text("utf-8")


def test_architecture_diagram_is_up_to_date() -> None:
    for floor, boxes in FLOORS.items():
        for box in boxes:
            place = ROOT / floor / box.folder
            assert place.is_dir() or place.with_suffix(".py").is_file(), f"{floor}/{box.folder}"
    stored = (IMAGES / "architecture.svg").read_text(encoding="utf-8")
    assert stored == architecture(), f"architecture.svg {STALE}"


def test_readme_caption_equals_the_one_stored_in_the_hero_image() -> None:
    with Image.open(PICTURE) as picture:
        stored = picture.info["Description"]
    assert caption_of(README) == stored, "python -m docs.make_hero"


@pytest.mark.slow
def test_new_run_gives_the_same_caption(tmp_path: Path) -> None:
    _, caption = hero(tmp_path)
    stored = caption_of(README)
    assert re.sub(NUMBER, "N", caption) == re.sub(NUMBER, "N", stored)
    measured = [[float(one) for one in re.findall(NUMBER, text)] for text in (caption, stored)]
    assert measured[0][1:4] == pytest.approx(measured[1][1:4], abs=0.01)  # RA, Dec, roll
