from pathlib import Path
from typing import Any

import pytest

from tests.emulator.recording import vcd

from ..browser import HOSTILE, line, look, saved, shown, station
from ..conftest import recorded_threshold

pytestmark = [pytest.mark.xdist_group("page acts"), pytest.mark.slow]

DEVICES = ("cubestar", "cubesense")


def test_changed_setting_is_marked(page: Any) -> None:
    look(page, "CubeSense")
    line(page, "write DetectionThreshold1 77")
    page.click("#read-settings")
    page.wait_for_selector("#settings-status >> text=/[0-9]+ of [0-9]+ differ/")
    row = page.locator("#settings-rows tr", has_text="DetectionThreshold1.Threshold")
    assert row.locator("td").nth(0).inner_text() == "77"
    assert row.locator("td").nth(1).inner_text() == "225"
    assert row.get_attribute("class") == "differs"
    other = page.locator("#settings-rows tr", has_text="DetectionThreshold2.Threshold")
    assert not other.get_attribute("class")
    assert page.locator("#read-sensor").is_disabled()
    assert "single registers" in page.inner_text("#sensor-status")


def test_page_names_image_sensor_registers(page: Any) -> None:
    page.click("#read-sensor")
    page.wait_for_selector("#sensor-status >> text=/ differ from their default$/")
    assert page.locator("#sensor-rows tr").count() == 9
    page.click("#settings summary >> text=image sensor register")
    row = page.locator("#sensor-rows tr", has_text="CLOCKS_PER_SECOND")
    assert len(row.locator("td").nth(0).inner_text()) == 8
    assert page.locator("#read-registers").is_disabled()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_waveform_of_the_pins_is_drawn(page: Any, tmp_path: Path) -> None:
    line(page, "write CaptureAndProcess")
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=true]")
    page.click("#show-waves")
    page.wait_for_selector("#waveform-status >> text=/ [1-9][0-9]* changes, the last at /")
    blue = (
        "() => { const c = document.querySelector('#waves');"
        "const d = c.getContext('2d').getImageData(190, 0, 810, c.height).data;"
        "let n = 0; for (let i = 0; i < d.length; i += 4) if (d[i + 2] > d[i] + 60) n++;"
        "return n }"
    )
    drawn = page.evaluate(blue)
    assert drawn > 1000
    page.click("#waves-out")
    assert page.evaluate(blue) != drawn
    with saved(page, "#save-waves", tmp_path / "a.vcd").open("rb") as stream:
        found = vcd.read(stream)
    assert max(time for all_of in found.values() for time, _ in all_of) > 0
    assert any(len(found[name]) > 2 for name in found if name.startswith("fpga."))
    page.fill("#trace-to", "1e6")
    page.click("#show-waves")
    page.wait_for_selector(
        "#waveform-status >> text=/at most 60 s long and before the current time/"
    )
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=false]")


def test_saved_lines_are_kept_per_device(page: Any) -> None:
    look(page, "CubeSense")
    page.fill("#line", "read Identification RuntimeSeconds")
    page.click("#save-line")
    page.fill("#line", HOSTILE)
    page.click("#save-line")
    page.reload()
    page.wait_for_selector("#take")
    look(page, "CubeStar")
    assert page.locator("#saved-lines li").count() == 0
    look(page, "CubeSense")
    assert page.locator("#saved-lines li").all_inner_texts()[0].startswith(HOSTILE)
    assert page.evaluate("document.hacked") is None
    page.click("#saved-lines >> text=read Identification RuntimeSeconds")
    page.wait_for_selector("#lines li.good >> text=RuntimeSeconds:")
    page.click(f"[aria-label='remove: {HOSTILE}']")
    assert page.locator("#saved-lines li").count() == 1
    page.evaluate("localStorage.setItem('cubestack lines CubeSense', '{nonsense')")
    page.reload()
    page.wait_for_selector("#save-line")
    look(page, "CubeSense")
    assert page.locator("#saved-lines li").count() == 0


def test_page_plays_a_recording(chromium: Any, tmp_path: Path) -> None:
    path = recorded_threshold(tmp_path / "run.rec", 60.0)
    with station(str(path)) as address, shown(chromium, address) as page:
        page.wait_for_selector("#playback-time >> text=/ of 6[0-9][.][0-9]+ s$/")
        page.select_option("#frame", "Configuration")
        cell = "#telemetry table tr >> nth=0"
        page.wait_for_selector(f"{cell} >> text=225")
        page.focus("#playback-position")
        page.press("#playback-position", "End")
        page.wait_for_selector(f"{cell} >> text=/9/")
        assert page.locator("#send").is_disabled()
        assert page.locator("#pause").is_disabled()
        assert page.locator("#download").is_disabled()
        assert "a recording" in page.inner_text("#commands")
        page.click("#play")
        page.wait_for_selector("#play >> text=Play")
        page.wait_for_selector("#scene-status >> text=/has no control port/")
        for control in ("#scene-apply", "#scene-load", "#scene-kind", "#scene-text"):
            assert page.locator(control).is_disabled()
            assert "no control port" in page.locator(control).get_attribute("title")
        assert not page.locator("#sky-map").is_visible()
