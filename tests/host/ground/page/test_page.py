from collections.abc import Iterator
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe

from tests.tiers import quick

from ..browser import LOOKS, check_layout, line, lives, look, shown

pytestmark = pytest.mark.xdist_group("page")  # so that its emulations are started once


def test_attitude_error_sphere_and_task_status_are_shown(page: Any) -> None:
    assert page.is_visible("#no-picture")  # no noise before the first image
    page.click("#take")
    page.wait_for_selector("#summary >> text=/^[1-9][0-9]* of [0-9]+ stars identified/")
    page.wait_for_selector("#angles td >> text=/^-?[0-9.]+″$/")
    assert not page.is_visible("#no-picture")
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
    page.wait_for_selector("#flags-set li.notice >> text=MaxStarsDetection")
    assert page.locator("#set-ErrorFlags li").count() == 1
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


@pytest.mark.slow
def test_timeline_is_read_zoomed_and_moved(page: Any) -> None:
    page.click("#add-band")
    page.wait_for_selector("#timeline-legend li")
    canvas, status = page.locator("#bands-canvas"), page.locator("#timeline-status")

    def read(share: float) -> float:
        """Time at a share of the axis, by the pointer; the values are read there."""
        box = canvas.bounding_box()
        page.hover("#bands-canvas", position={"x": share * box["width"], "y": 30})
        page.wait_for_function(
            "() => document.querySelector('#timeline-status').textContent.startsWith('at ')"
        )
        return float(status.inner_text().removeprefix("at ").split(" s: ")[0])

    assert read(0.75) - read(0.25) == pytest.approx(30, abs=0.5)
    following = "#timeline-follow[aria-pressed={}]"
    canvas.press("+")
    assert read(0.75) - read(0.25) == pytest.approx(15, abs=1.5)  # time passes meanwhile
    page.wait_for_selector(following.format("true"))
    page.click("#timeline-out")
    page.click("#timeline-in")
    page.wait_for_function(
        "() => Number(document.querySelector('#time').textContent.match(/[0-9.]+/)) > 33"
    )
    canvas.press("Shift+ArrowLeft")
    page.wait_for_selector(following.format("false"))
    held = read(0.5)
    assert read(0.5) == held
    canvas.press("ArrowLeft")
    read_there = "parseFloat(document.querySelector('#timeline-status').textContent.slice(3))"
    page.wait_for_function(f"held => {read_there} < held", arg=held)
    canvas.press("0")
    page.wait_for_selector(following.format("true"))
    page.mouse.move(0, 0)
    page.wait_for_function(
        "() => !document.querySelector('#timeline-status').textContent.startsWith('at ')"
    )


@pytest.mark.slow
def test_zoomed_plot_stays_while_values_arrive(page: Any) -> None:
    page.select_option("#frame", "Identification")
    page.check("[title='plot RuntimeSeconds']")
    points = "() => document.querySelector('#plot canvas')"
    page.wait_for_function(points)
    sent = "Number(document.querySelector('#link-health').textContent.match(/[0-9]+/))"

    def latest() -> str:
        """Time at the right edge of the plot, after three more updates."""
        before = page.evaluate(sent)
        page.wait_for_function(f"before => {sent} > before + 3", arg=before)
        box = page.locator("#plot .u-over").bounding_box()
        page.hover("#plot .u-over", position={"x": 5, "y": 20})
        page.hover("#plot .u-over", position={"x": box["width"] - 1, "y": 20})
        return str(page.locator("#plot .u-legend .u-value").first.inner_text())

    assert latest() != latest()
    page.click("#plot-in")
    page.click("#plot-earlier")
    held = latest()
    assert latest() == held
    page.click("#plot-all")
    assert latest() != held


def seconds(page: Any) -> float:
    """The time that a page shows."""
    return float(page.inner_text("#time").split()[0])


@pytest.mark.slow
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


@pytest.mark.slow
def test_results_and_flags_of_a_time_that_has_not_come_are_cleared(page: Any) -> None:
    before = page.locator("#snapshots option").count()
    page.click("#snapshot")
    page.wait_for_function(
        "(before) => document.querySelector('#snapshots').options.length > before", arg=before
    )
    page.click("#take")
    # A summary may be there already. Time that went back now would leave the picture unanswered.
    page.wait_for_selector("#lines li.good >> text=take a picture")
    page.wait_for_selector("#summary >> text=/stars identified/")
    page.wait_for_selector("#flags-set li.notice")
    page.click("#back")
    page.wait_for_selector("#summary >> text=/Time went back/")
    assert page.locator("#flags-set li").count() == 0
    assert set(page.locator("#angles td").all_inner_texts()) == {"\N{EN DASH}"}
    page.wait_for_selector("#pause[aria-pressed=true]")
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=false]")
    page.wait_for_function(
        "() => !document.querySelector('#summary').textContent.includes('Time went back')"
    )


@pytest.mark.slow
def test_time_goes_back_while_the_emulation_does_not_answer(page: Any) -> None:
    told = [0]

    def change(message: dict[str, Any]) -> dict[str, Any]:
        told[0] += 1
        if told[0] == 1:
            return message
        for name in ("results", "values"):
            message.pop(name, None)
        if told[0] == 2:
            return message | {"emulation": {"error": "no answer"}, "pictures": None}
        return message | {"emulation": message["emulation"] | {"time_s": 0.0}}

    lives(page, change)
    page.wait_for_selector("#summary >> text=/Time went back/")


@pytest.mark.slow
def test_two_tabs_share_the_state_and_show_different_targets(
    chromium: Any, address: str, page: Any
) -> None:
    with shown(chromium, address) as other:
        page.click("#pause")
        other.wait_for_selector("#pause[aria-pressed=true]")
        other.click("#pause")
        page.wait_for_selector("#pause[aria-pressed=false]")
        look(other, "CubeSense")
        page.select_option("#band", "IDMode.Mode")
        page.click("#add-band")
        other.select_option("#band", "NadirSearchMode.Search")
        other.click("#add-band")
        page.wait_for_selector("#timeline-status >> text=/IDMode.Mode [A-Z]/")
        other.wait_for_selector("#timeline-status >> text=/NadirSearchMode.Search [A-Z]/")
        assert "Nadir" not in page.inner_text("#timeline-status")
        assert other.locator("#supplies li").count() > page.locator("#supplies li").count()


def test_page_works_with_the_keyboard_only(page: Any) -> None:
    page.click("#tab-commands")
    """All is reached by the tab key, in order, and does what a click does."""
    page.focus("#freeze")
    reached = list[str]()
    for _ in range(40):
        reached.append(page.evaluate("document.activeElement.id"))
        page.keyboard.press("Tab")
    sought = ("freeze", "take", "zoom-in", "tab-commands", "command", "send", "line")
    at = [reached.index(name) for name in sought]
    assert at == sorted(at)
    page.focus("#take")

    def tab_to(name: str) -> None:
        for _ in range(60):
            if page.evaluate("document.activeElement.id") == name:
                return
            page.keyboard.press("Tab")

    tab_to(page.evaluate("document.querySelector('[aria-selected=true]').id"))
    page.keyboard.press("Home")
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    tab_to("pause")
    page.keyboard.press("Enter")
    page.wait_for_selector("#pause[aria-pressed=true]")
    page.keyboard.press("Space")
    page.wait_for_selector("#pause[aria-pressed=false]")


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "width"), LOOKS)
def test_page_has_no_overflow_overlap_or_low_contrast(
    chromium: Any, address: str, scheme: str, width: int
) -> None:
    """What axe finds depends on a device's fields, not on the look, so it sees one device."""
    size = {"width": width, "height": 850}
    devices = ("AraMiS", "CubeSense", "CubeStar")
    judged = devices[LOOKS.index((scheme, width)) % len(devices)]
    with shown(chromium, address, viewport=size, color_scheme=scheme) as page:
        for device in devices:
            look(page, device)
            page.click("#add-band")
            page.wait_for_selector("#timeline-legend li")
            for number in range(1, page.locator("[role=tab]").count() + 1):
                page.click("h1")
                page.keyboard.press(str(number))
                check_layout(page, width)
                if device == judged:
                    assert Axe().run(page).response["violations"] == []
        dark = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 28)"
        assert dark == (scheme == "dark")


@pytest.mark.parametrize(("width", "height"), quick([(1280, 900), (390, 844)], 1))
def test_first_minute_needs_one_click_and_no_scrolling(
    chromium: Any, address: str, width: int, height: int
) -> None:
    with shown(chromium, address, viewport={"width": width, "height": height}) as page:
        for device in ("CubeStar", "CubeSense", "AraMiS"):
            look(page, device)
            page.wait_for_selector("#angles")
            before = page.evaluate(PLACES)
            page.click("#take")
            page.wait_for_selector("#lines li.good >> text=take a picture")
            page.wait_for_selector("#angles td >> text=/[0-9]/")
            assert page.evaluate("scrollY") == 0
            places = page.evaluate(PLACES)
            assert all(top >= 0 and bottom <= height for top, bottom in places.values())
            if width > 1000:  # nothing jumps
                assert places == before


PLACES = """() => {
  const ids = ["link", "take", "zoom-frame", "summary", "angles"];
  return Object.fromEntries(ids.map((id) => {
  const { top, bottom } = document.getElementById(id).closest(".under, :not(.under *)")
    .getBoundingClientRect();
  return [id, [Math.round(top), Math.round(bottom)]];
}))}"""
"""Top and bottom of what an operator needs at once."""


@pytest.mark.slow
def test_address_names_the_target_and_the_tab(chromium: Any, address: str) -> None:
    with shown(chromium, address) as page:
        assert "seed 5" in page.inner_text("#chosen")
        look(page, "CubeSense")
        page.click("#tab-faults")
        assert page.evaluate("location.hash") == "#CubeSense/faults"
        page.reload()
        page.wait_for_selector("#inject", state="visible")
        assert page.title().startswith("CubeSense")


def test_risky_command_asks_first(page: Any) -> None:
    assert page.evaluate("document.querySelector('#command').value") == "setDelayTimerTimeout"
    page.select_option("#command", "Reset")
    page.click("#send")
    page.wait_for_selector("dialog >> text=The program restarts")
    before = page.locator("#lines li").count()
    page.click("dialog >> text=Cancel")
    assert page.locator("#lines li").count() == before
    page.click("#send")
    page.click("#confirm")
    page.wait_for_selector("#lines li.good >> text=write Reset")


@pytest.mark.slow
def test_paused_display_holds_its_values(chromium: Any, address: str, page: Any) -> None:
    page.click("#freeze")
    held = seconds(page)
    with shown(chromium, address) as other:
        look(other, "CubeStar")
        other.wait_for_function(
            "(held) => parseFloat(document.querySelector('#time').textContent) > held + 2.2",
            arg=held,
        )
        assert seconds(page) < held + 2  # at most the update that was under way
    page.click("#freeze")
    page.wait_for_function(
        "(held) => parseFloat(document.querySelector('#time').textContent) > held + 2.2", arg=held
    )


# --- on one page, one after the other -------------------------------------------------------------


@pytest.fixture(scope="module")
def kept(chromium: Any, address: str) -> Iterator[Any]:
    with shown(chromium, address) as opened:
        look(opened, "CubeStar")
        yield opened


def test_command_changes_the_device(kept: Any) -> None:
    kept.select_option("#frame", "DetectionThresholdValues")
    kept.select_option("#command", "setDetectionThresholds")
    kept.fill("[name=DetectionThreshold]", "33")
    kept.fill("[name=StarThreshold]", "34")
    kept.click("#send")
    kept.wait_for_function("() => document.querySelector('#telemetry').innerText.includes('33')")
    kept.check("[title='plot DetectionThreshold']")
    kept.wait_for_selector("#plot canvas")


@pytest.mark.slow
def test_errors_are_shown_as_text(kept: Any) -> None:
    told = line(kept, "read <img/src=x/onerror=document.hacked=1>")
    assert "<img" in told
    assert kept.locator("#lines li.bad").count() == 1
    assert kept.evaluate("document.hacked") is None
    assert kept.locator("#lines img").count() == 0


def test_fault_is_injected_and_logged(kept: Any) -> None:
    faults = kept.locator("#fault option").all_inner_texts()
    reset = next(fault for fault in faults if fault.startswith("processor-reset "))
    kept.select_option("#fault", reset)
    kept.click("#inject")
    kept.wait_for_selector(f"#lines li >> text=/ s {reset}: /")


def test_time_is_paused_stepped_and_resumed(kept: Any) -> None:
    kept.click("#pause")
    kept.wait_for_selector("#pause[aria-pressed=true]")
    kept.click("#step")
    kept.wait_for_selector("#lines li.good >> text=step")
    to_s = round(seconds(kept)) + 50
    kept.fill("#to", str(to_s))
    kept.click("#go")
    kept.wait_for_function(
        f"() => document.querySelector('#time').textContent.startsWith('{to_s}.0')"
    )
    kept.click("#pause")
    kept.wait_for_selector("#pause[aria-pressed=false]")
