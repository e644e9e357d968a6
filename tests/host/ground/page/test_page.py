from typing import Any

import pytest

from tests.tiers import quick

from ..browser import LOOKS, check_layout, line, look, shown

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
