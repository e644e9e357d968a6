from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.host.pictures.images import save_picture

from ..browser import line, look, saved

pytestmark = pytest.mark.xdist_group("page")  # beside others: one browser

GREEN = (
    "() => { const c = document.querySelector('#overlay');"
    "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
    "let n = 0; for (let i = 0; i < d.length; i += 4) if (d[i + 1] > d[i] + 60) n++;"
    "return n }"
)
"""Counts the green pixels drawn over the picture."""


@pytest.mark.slow
def test_page_shows_the_captured_image(page: Any) -> None:
    page.select_option("#command", "CaptureAndProcess")
    page.click("#send")
    # At power-up a memory holds noise; the picture is a dark sky with stars.
    page.wait_for_function(
        "() => { const c = document.querySelector('#canvas');"
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        "const lit = d.filter((v, i) => i % 4 === 0 && v > 200).length;"
        "return c.width === 1024 && lit > 10 && lit < 20000 }"
    )
    page.check("#detections")
    page.wait_for_selector("#picture >> text=/detected, .* identified/")
    page.select_option("#frame", "AttitudeQuaternion")
    page.wait_for_function(
        "() => document.querySelector('#telemetry').innerText.includes('LOST_IN')"
    )


@pytest.mark.slow
def test_found_edges_are_drawn(page: Any) -> None:
    look(page, "CubeSense")
    page.wait_for_selector("#attitude-status >> text=CubeSense reports no attitude")
    page.check("#detections")
    line(page, "write CaptureAndDetect Camera=NADIR Sram=SRAM2")
    page.wait_for_selector("#picture >> text=/^[1-9][0-9]* (points of .* )?detected/")
    assert page.evaluate(GREEN) > 50
    assert page.locator("#detections-legend").is_visible()


@pytest.mark.slow
def test_page_image_is_zoomed_and_moved(page: Any) -> None:
    picture = page.locator("#zoom-frame")
    wide = "document.querySelector('#canvas').clientWidth"
    shifted = "document.querySelector('#zoom-frame').scrollLeft"
    page.wait_for_function("() => document.querySelector('#canvas').width === 1024")
    before = page.evaluate(wide)
    picture.press("+")
    assert page.evaluate(wide) == pytest.approx(2 * before, abs=2)
    assert page.evaluate(shifted) == pytest.approx(before / 2, abs=3)  # its middle stays
    page.keyboard.press("ArrowLeft")
    page.wait_for_function(f"() => {shifted} < {before / 2 - 10}")
    page.keyboard.press("0")
    assert page.evaluate(wide) == before
    picture.hover()
    page.mouse.wheel(0, -100)
    page.wait_for_function(f"() => {wide} > {before}")
    page.keyboard.press("0")
    page.keyboard.press("+")
    at = page.evaluate(shifted)
    picture.hover()
    box = picture.bounding_box()
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 40, box["y"] + box["height"] / 2)
    page.mouse.up()
    assert page.evaluate(shifted) == at - 40
    page.click("#zoom-fit")
    assert page.evaluate(wide) == before


@pytest.mark.slow
def test_page_draws_magnitudes(page: Any) -> None:
    page.check("#detections")
    line(page, "write CaptureAndProcess")
    page.wait_for_selector("#picture >> text=/detected, .* identified/")
    page.wait_for_function(f"() => ({GREEN})() > 50")
    before = page.evaluate(GREEN)
    page.check("#magnitudes")
    # A picture that comes meanwhile has nothing to be seen until it is read.
    page.wait_for_function(f"() => ({GREEN})() > {before}")


@pytest.mark.slow
def test_image_is_uploaded_and_downloaded(page: Any, tmp_path: Path) -> None:
    picture = np.random.default_rng(1).integers(0, 2, (512, 1024), np.uint8) * 200
    picture[40:] = 0  # black blocks are not sent
    sent = tmp_path / "sent.png"
    save_picture(picture, sent)
    page.select_option("#speed", "fast")
    page.set_input_files("#upload", sent)
    page.wait_for_selector("#transfer-status >> text=/^upload: .* done$/")
    page.click("#download")
    page.wait_for_function("() => document.querySelector('#progress').value > 20")
    page.click("#pause-transfer")
    page.wait_for_selector("#transfer-status >> text=/ paused$/")
    page.click("#pause-transfer")
    page.wait_for_selector("#transfer-status >> text=/^download: 4096 of 4096 blocks, done$/")
    back = saved(page, "#save-image", tmp_path / "back.png")
    assert np.array_equal(np.asarray(Image.open(back)), picture)
    page.click("#download")
    page.wait_for_selector("#transfer-status >> text=/^download: .* in progress/")
    page.click("#cancel-transfer")
    page.wait_for_selector("#transfer-status >> text=/cancelled after/")
    page.select_option("#speed", "1")
    look(page, "CubeSense")
    assert page.locator("#upload").is_disabled()
    assert "no image upload" in page.inner_text("#transfer-status")
    assert page.locator("#source option").all_inner_texts() == ["sram1", "sram2"]


@pytest.mark.slow
def test_page_refresh_rate_is_selectable(page: Any) -> None:
    page.evaluate(
        "() => { window.asked = []; const send = WebSocket.prototype.send;"
        "WebSocket.prototype.send = function (text) {"
        "  window.asked.push(JSON.parse(text).every_s); send.call(this, text) } }"
    )
    for rate, seconds in (("5", 0.2), ("2", 0.5)):
        page.select_option("#rate", rate)
        assert page.evaluate("window.asked.at(-1)") == seconds
