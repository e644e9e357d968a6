"""The diagrams of the sensors' pages are those of the runs that are made anew."""

import importlib.util
from pathlib import Path

import pytest

from .conftest import ROOT

IMAGES = ROOT / "docs" / "images" / "sensors"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    path = ROOT / "docs" / "make_diagrams.py"
    spec = importlib.util.spec_from_file_location("make_diagrams", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: dict[str, str] = module.diagrams(tmp_path_factory.mktemp("traces"))
    return found


def test_committed_diagrams_are_today_s(made: dict[str, str]) -> None:
    assert {path.name for path in IMAGES.glob("*.svg")} == {*made}
    for name, text in made.items():
        assert (IMAGES / name).read_text(encoding="utf-8") == text, (
            f"{name} is not of today: python docs/make_diagrams.py"
        )


def test_every_diagram_is_on_its_sensor_s_page(made: dict[str, str]) -> None:
    for name in made:
        page = Path(ROOT / "docs" / f"sensor-{name.split('-')[0]}.md").read_text(encoding="utf-8")
        assert f"](images/sensors/{name})" in page
