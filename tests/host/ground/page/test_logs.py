import csv
import os
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest

from cubestack.host.cli.main import main
from cubestack.host.emulation.process import emulating
from cubestack.host.recording.transcript import COLUMNS

from ..browser import line, port_of, saved, shown, station

pytestmark = [pytest.mark.xdist_group("page logs"), pytest.mark.slow]


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def same(cell: Any, text: str) -> bool:
    """Whether a Parquet cell equals a CSV cell."""
    if cell is None or text == "":
        return cell in (None, "") and text == ""
    return float(text) == cell if isinstance(cell, float) else str(cell) == text


def test_csv_and_parquet_tables_are_equal(chromium: Any, tmp_path: Path) -> None:
    with station("emulated:cubestar", "--seed", "5") as address, shown(chromium, address) as page:
        line(page, "write setDetectionThresholds 33 34")
        line(page, "write CaptureAndProcess")
        page.locator("#attitude-status").filter(has_text="measured").wait_for(state="attached")
        page.uncheck("#results-on")
        for name, buttons in (
            ("results", ("#save", "#save-parquet")),
            ("said", ("#transcript-csv", "#transcript-parquet")),
        ):
            rows = rows_of(saved(page, buttons[0], tmp_path / f"{name}.csv"))
            path = saved(page, buttons[1], tmp_path / f"{name}.parquet")
            table = pyarrow.parquet.read_table(path).to_pylist()
            assert len(rows) > 1
            for row, cells in zip(rows, table, strict=False):
                assert row.keys() == cells.keys()
                assert all(same(cells[key], row[key]) for key in row), (row, cells)
        with page.expect_download() as saving:
            page.click("#recording")
        assert saving.value.suggested_filename == "cubestar.rec"
        recording = tmp_path / "a.rec"
        saving.value.save_as(recording)
    assert main(["replay", str(recording)]) == 0
    results = pyarrow.parquet.read_table(tmp_path / "results.parquet")
    assert str(results.schema.field("ra_deg").type) == "double"
    said = rows_of(tmp_path / "said.csv")
    assert tuple(said[0]) == COLUMNS
    assert ("setDetectionThresholds", "33.0") in {(one["message"], one["value"]) for one in said}
    assert main(["decode", str(recording), "--out", str(tmp_path / "by-command.csv")]) == 0
    assert rows_of(tmp_path / "by-command.csv")[: len(said)] == said


def test_saved_session_is_opened_later(chromium: Any, tmp_path: Path) -> None:
    kept = tmp_path / "session.rec"
    with emulating(["cubesense", "--tcp", "0"]) as said:
        words = [port_of(said), "--device", "cubesense", "--record", str(kept)]
        with station(*words) as address, shown(chromium, address) as page:
            line(page, "write DetectionThreshold1 77")
            line(page, "read Configuration")
            path = saved(page, "#recording", tmp_path / "saved.rec")
            assert kept.read_bytes().startswith(path.read_bytes())
    with station(str(path)) as address, shown(chromium, address) as page:
        page.select_option("#frame", "Configuration")
        page.press("#playback-position", "End")
        page.locator("#telemetry td.value").first.filter(has_text="77").wait_for(state="attached")
        assert saved(page, "#recording", tmp_path / "again.rec").read_bytes() == path.read_bytes()
        rows = rows_of(saved(page, "#transcript-csv", tmp_path / "said.csv"))
    assert "DetectionThreshold1" in {row["message"] for row in rows}


def test_unavailable_downloads_are_disabled(chromium: Any, tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import sys; sys.modules['pyarrow'] = None\n")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    with emulating(["cubesense", "--tcp", "0"]) as said:
        words = [port_of(said), "--device", "cubesense"]
        with station(*words, environment=environment) as address, shown(chromium, address) as page:
            page.wait_for_selector("#transcript >> text=start with --record FILE")
            for button in ("#recording", "#transcript-csv", "#transcript-parquet", "#save-parquet"):
                assert page.locator(button).is_disabled()
            assert "pip install" in page.locator("#save-parquet").get_attribute("title")
            assert page.locator("#save").is_enabled()
