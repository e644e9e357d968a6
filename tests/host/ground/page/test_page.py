from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.host.pictures.images import save_picture
from tests.tiers import quick

from ..browser import LOOKS, check_layout, line, look, saved, shown

pytestmark = pytest.mark.xdist_group("page")  # so that its emulations are started once


def test_attitude_error_sphere_and_task_status_are_shown(page: Any) -> None:
    page.select_option("#command", "CaptureAndProcess")
    page.click("#send")
    told = page.locator("#attitude-status")
    page.wait_for_function(
        "() => / total error [0-9.]+°$/"
        ".test(document.querySelector('#attitude-status').textContent)"
    )
    assert float(told.inner_text().split("error ")[1].split("°")[0]) < 0.1
    before = page.evaluate("document.querySelector('#sphere').toDataURL()")
    page.press("#sphere", "ArrowLeft")
    assert page.evaluate("document.querySelector('#sphere').toDataURL()") != before
    page.wait_for_selector("#timeline-status >> text=/task CALCULATED/")
    # More stars than it lists, which is a flag of its own.
    page.wait_for_selector("#health li.lit >> text=MaxStarsDetection")
    assert page.locator("#health li.lit").count() == 1
    assert " 0 failed" in page.inner_text("#link-health")
    assert "imager" in page.inner_text("#supplies")


@pytest.mark.slow
def test_telemetry_word_is_shown_as_a_band(page: Any) -> None:
    fields = page.locator("#band option").all_inner_texts()
    assert len(fields) > 3
    page.select_option("#band", "AttitudeQuaternion.Mode")
    page.press("#add-band", "Enter")
    page.wait_for_selector("#timeline-status >> text=AttitudeQuaternion.Mode")
    word = page.inner_text("#timeline-status").split("AttitudeQuaternion.Mode ")[1].split(",")[0]
    assert not word.isdigit()
    assert word in page.locator("#timeline-legend li").all_inner_texts()
    tall = "document.querySelector('#bands-canvas').height"
    before = page.evaluate(tall)
    page.press("#bands button", "Enter")
    page.wait_for_function(f"() => {tall} < {before}")
    assert "AttitudeQuaternion" not in page.inner_text("#timeline-status")
    assert page.evaluate("document.activeElement.id") == "band"
    look(page, "AraMiS")
    assert page.locator("#band option").all_inner_texts() != fields


def test_command_changes_the_device(page: Any) -> None:
    page.select_option("#frame", "DetectionThresholdValues")
    page.select_option("#command", "setDetectionThresholds")
    page.fill("[name=DetectionThreshold]", "33")
    page.fill("[name=StarThreshold]", "34")
    page.click("#send")
    page.wait_for_function("() => document.querySelector('#telemetry').innerText.includes('33')")
    page.check("[title='plot DetectionThreshold']")
    page.wait_for_selector("#plot canvas")


def test_errors_are_shown_as_text(page: Any) -> None:
    told = line(page, "read <img/src=x/onerror=document.hacked=1>")
    assert "<img" in told
    assert page.locator("#lines li.bad").count() == 1
    assert page.evaluate("document.hacked") is None
    assert page.locator("#lines img").count() == 0


def test_chosen_options_are_shown(page: Any) -> None:
    assert "seed 5" in page.inner_text("#chosen")


def test_time_is_paused_stepped_and_resumed(page: Any) -> None:
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=true]")
    page.click("#step")
    page.wait_for_selector("#lines li.good >> text=step")
    page.fill("#to", "5000")
    page.click("#go")
    page.wait_for_function("() => document.querySelector('#time').textContent.startsWith('5000.0')")
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=false]")


def test_back_returns_to_a_snapshot(page: Any) -> None:
    look(page, "CubeSense")
    line(page, "write DetectionThreshold1 7")
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=true]")
    page.click("#snapshot")
    page.wait_for_function("() => document.querySelector('#snapshots').options.length === 1")
    page.click("#pause")
    line(page, "write DetectionThreshold1 9")
    assert "Threshold1: 9" in line(page, "read Configuration")
    page.click("#back")
    page.wait_for_selector("#lines li.good >> text=back")
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=false]")
    # What ran before it is made up for first, which may outlast a request.
    told = next(
        told for _ in range(20) if "no answer" not in (told := line(page, "read Configuration"))
    )
    assert "Threshold1: 7" in told


def test_fault_is_injected_and_logged(page: Any) -> None:
    faults = page.locator("#fault option").all_inner_texts()
    reset = next(fault for fault in faults if fault.startswith("processor-reset "))
    page.select_option("#fault", reset)
    page.click("#inject")
    page.wait_for_selector(f"#lines li >> text=/ s {reset}: /")


def test_two_tabs_share_the_state(chromium: Any, address: str, page: Any) -> None:
    with shown(chromium, address) as other:
        page.click("#pause")
        other.wait_for_selector("#pause[aria-pressed=true]")
        other.click("#pause")
        page.wait_for_selector("#pause[aria-pressed=false]")


def test_two_tabs_show_different_targets(chromium: Any, address: str, page: Any) -> None:
    with shown(chromium, address) as other:
        look(other, "CubeSense")
        page.select_option("#band", "IDMode.Mode")
        page.click("#add-band")
        other.select_option("#band", "NadirSearchMode.Search")
        other.click("#add-band")
        page.wait_for_selector("#timeline-status >> text=/IDMode.Mode [A-Z]/")
        other.wait_for_selector("#timeline-status >> text=/NadirSearchMode.Search [A-Z]/")
        assert "Nadir" not in page.inner_text("#timeline-status")
        assert other.locator("#supplies li").count() > page.locator("#supplies li").count()


def test_tab_key_reaches_every_control_in_order(page: Any) -> None:
    page.wait_for_selector("#sphere:visible")
    page.focus("#picture-name")
    reached = list[str]()
    for _ in range(80):
        reached.append(page.evaluate("document.activeElement.id"))
        page.keyboard.press("Tab")
    sought = ("magnitudes", "zoom-frame", "sphere", "band", "add-band", "lamps-ErrorFlags")
    at = [reached.index(name) for name in sought]
    assert at == sorted(at)


def test_page_works_with_the_keyboard_only(page: Any) -> None:
    page.focus("#newest")
    for _ in range(150):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "pause":
            break
    page.keyboard.press("Enter")
    page.wait_for_selector("#pause[aria-pressed=true]")
    page.keyboard.press("Space")
    page.wait_for_selector("#pause[aria-pressed=false]")


@pytest.mark.parametrize(("scheme", "width"), quick(LOOKS, 2))
def test_page_has_no_overflow_overlap_or_low_contrast(
    chromium: Any, address: str, scheme: str, width: int
) -> None:
    size = {"width": width, "height": 850}
    with shown(chromium, address, viewport=size, color_scheme=scheme) as page:
        for device in ("AraMiS", "CubeSense", "CubeStar"):
            look(page, device)
            page.click("#add-band")
            page.wait_for_selector("#timeline-legend li")
            check_layout(page, width)
        dark = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 28)"
        assert dark == (scheme == "dark")


# --- the picture ----------------------------------------------------------------------------------

GREEN = (
    "() => { const c = document.querySelector('#overlay');"
    "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
    "let n = 0; for (let i = 0; i < d.length; i += 4) if (d[i + 1] > d[i] + 60) n++;"
    "return n }"
)
"""Counts the green pixels drawn over the picture."""


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


def test_found_edges_are_drawn(page: Any) -> None:
    look(page, "CubeSense")
    page.wait_for_selector("#attitude-status >> text=CubeSense reports no attitude")
    page.check("#detections")
    line(page, "write CaptureAndDetect Camera=NADIR Sram=SRAM2")
    page.wait_for_selector("#picture >> text=/^[1-9][0-9]* detected/")
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
