"""The page in a real browser, at emulations of all sensors."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.host.devices.registry import device_names
from cubestack.host.pictures.images import save_picture

SOON_MS = 30_000

GREEN = (
    "() => { const c = document.querySelector('#over');"
    "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
    "let n = 0; for (let i = 0; i < d.length; i += 4) if (d[i + 1] > d[i] + 60) n++;"
    "return n }"
)
"""Pixels of what is drawn over the picture that are green."""

COVERED = """() => {
  const all = [...document.querySelectorAll("button, input, select, canvas, p, h1, h2, li, td")];
  const seen = all.filter((one) => one.checkVisibility() && !one.closest("#lines, .under"));
  const shown = (one) => { // without what is scrolled out of sight
    let { left, right, top, bottom } = one.getBoundingClientRect();
    for (let up = one.parentElement; up !== document.body; up = up.parentElement) {
      if (getComputedStyle(up).overflow === "visible") continue;
      const frame = up.getBoundingClientRect();
      left = Math.max(left, frame.left), right = Math.min(right, frame.right);
      top = Math.max(top, frame.top), bottom = Math.min(bottom, frame.bottom);
    }
    return { left, right, top, bottom };
  };
  const boxes = seen.map(shown);
  const meet = (a, b) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const found = [];
  seen.forEach((one, i) => seen.slice(i + 1).forEach((other, j) => {
    if (one.contains(other) || !meet(boxes[i], boxes[i + 1 + j])) return;
    found.push(`${one.outerHTML.slice(0, 60)} and ${other.outerHTML.slice(0, 60)}`);
  }));
  return found;
}"""
"""What lies on something else."""

PALE = """() => {
  const numbers = (colour) => colour.match(/[0-9.]+/g).map(Number);
  const light = (colour) => numbers(colour).slice(0, 3).reduce((sum, part, i) => {
    const share = part / 255;
    const linear = share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
    return sum + [0.2126, 0.7152, 0.0722][i] * linear;
  }, 0.05);
  const ground = (one) => {
    const colour = getComputedStyle(one).backgroundColor;
    return numbers(colour)[3] === 0 ? ground(one.parentElement) : colour;
  };
  const own = (one) => [...one.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
  return [...document.body.querySelectorAll("*")]
    .filter((one) => own(one) && one.checkVisibility() && !one.matches("option, :disabled"))
    .map((one) => [one, light(getComputedStyle(one).color), light(ground(one))])
    .filter(([, a, b]) => Math.max(a, b) / Math.min(a, b) < 4.5)
    .map(([one]) => one.outerHTML.slice(0, 80));
}"""
"""Text with less contrast than WCAG 2.2, 1.4.3, asks for."""

pytestmark = pytest.mark.xdist_group("page")  # so that its emulations are started once


@pytest.fixture(scope="module")
def address(chromium: Any) -> Iterator[str]:
    targets = [f"emulated:{name}" for name in device_names()]
    call = [sys.executable, "-m", "cubestack", "ground", *targets, "--json", "--seed", "5"]
    with subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as station:
        assert station.stdout is not None
        yield json.loads(station.stdout.readline())["page"]
        station.send_signal(signal.SIGINT)


@pytest.fixture
def page(chromium: Any, address: str) -> Iterator[Any]:
    page = opened(chromium, address)
    wrong = list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda one: wrong.append(one.url) if not local(one.url) else None)
    yield page
    page.context.close()
    assert not wrong


def opened(chromium: Any, address: str, **options: Any) -> Any:
    page = chromium.new_context(**options).new_page()
    page.set_default_timeout(SOON_MS)
    page.goto(address)
    look(page, "CubeStar")
    return page


def look(page: Any, device: str) -> None:
    page.click(f"nav >> text={device}")
    page.wait_for_function("() => document.querySelector('#time').textContent.endsWith(' s')")


def local(url: str) -> bool:
    return url.startswith(("http://127.0.0.1:", "data:", "blob:"))


def line(page: Any, words: str) -> str:
    """Do a line of the shell; what the page tells of it."""
    before = page.locator("#lines li").count()
    page.fill("#line", words)
    page.press("#line", "Enter")
    page.wait_for_function(
        "([words, before]) => { const told = document.querySelectorAll('#lines li');"
        "return told.length > before && told[0].innerText.includes(words) }",
        arg=[words, before],
    )
    return str(page.locator("#lines li").first.inner_text())


def test_a_picture_is_seen_when_it_is_taken(page: Any) -> None:
    page.select_option("#command", "CaptureAndProcess")
    page.click("#send")
    # At power-up a memory holds noise; the picture is a dark sky with stars.
    page.wait_for_function(
        "() => { const c = document.querySelector('#canvas');"
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        "const lit = d.filter((v, i) => i % 4 === 0 && v > 200).length;"
        "return c.width === 1024 && lit > 10 && lit < 20000 }"
    )
    page.check("#marks")
    page.wait_for_selector("#picture >> text=/found, .* of them known/")
    page.select_option("#frame", "AttitudeQuaternion")
    page.wait_for_function(
        "() => document.querySelector('#telemetry').innerText.includes('LOST_IN')"
    )


def test_attitude_words_and_flags_are_shown(page: Any) -> None:
    page.select_option("#command", "CaptureAndProcess")
    page.click("#send")
    told = page.locator("#attitude-told")
    page.wait_for_function(
        "() => / error [0-9.]+° in all$/.test(document.querySelector('#attitude-told').textContent)"
    )
    assert float(told.inner_text().split("error ")[1].split("°")[0]) < 0.1
    before = page.evaluate("document.querySelector('#sphere').toDataURL()")
    page.press("#sphere", "ArrowLeft")
    assert page.evaluate("document.querySelector('#sphere').toDataURL()") != before
    page.wait_for_selector("#timeline-told >> text=/task CALCULATED/")
    # More stars than it lists, which is a flag of its own.
    page.wait_for_selector("#health li.lit >> text=MaxStarsDetection")
    assert page.locator("#health li.lit").count() == 1
    assert " 0 failed" in page.inner_text("#link-health")
    assert "imager" in page.inner_text("#supplies")


def test_any_word_of_telemetry_is_a_band(page: Any) -> None:
    """Chosen and removed by keys; what it is now, and what its colours mean, are in words."""
    fields = page.locator("#band option").all_inner_texts()
    assert len(fields) > 3
    page.select_option("#band", "AttitudeQuaternion.Mode")
    page.press("#add-band", "Enter")
    page.wait_for_selector("#timeline-told >> text=AttitudeQuaternion.Mode")
    word = page.inner_text("#timeline-told").split("AttitudeQuaternion.Mode ")[1].split(",")[0]
    assert not word.isdigit()
    assert word in page.locator("#timeline-legend li").all_inner_texts()
    tall = "document.querySelector('#timeline').height"
    before = page.evaluate(tall)
    page.press("#bands button", "Enter")
    page.wait_for_function(f"() => {tall} < {before}")
    assert "AttitudeQuaternion" not in page.inner_text("#timeline-told")
    assert page.evaluate("document.activeElement.id") == "band"
    look(page, "AraMiS")
    assert page.locator("#band option").all_inner_texts() != fields


def test_what_it_found_is_drawn_and_enlarged(page: Any) -> None:
    look(page, "CubeSense")
    page.wait_for_selector("#attitude-told >> text=CubeSense answers no attitude")
    page.check("#marks")
    line(page, "write CaptureAndDetect Camera=NADIR Sram=SRAM2")
    page.wait_for_selector("#picture >> text=/^[1-9][0-9]* found/")
    assert page.evaluate(GREEN) > 50
    assert page.locator("#found-legend").is_visible()


def test_a_picture_is_enlarged_and_moved(page: Any) -> None:
    """By keys alone, by the wheel once it is chosen, and by the pointer."""
    picture = page.locator("#frame-of-picture")
    wide = "document.querySelector('#canvas').clientWidth"
    shifted = "document.querySelector('#frame-of-picture').scrollLeft"
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
    assert page.evaluate(wide) > before
    page.keyboard.press("0")
    page.keyboard.press("+")
    at = page.evaluate(shifted)
    picture.hover()
    box = picture.bounding_box()
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 40, box["y"] + box["height"] / 2)
    page.mouse.up()
    assert page.evaluate(shifted) == at - 40
    page.click("#sizes >> text=whole")
    assert page.evaluate(wide) == before


def test_stars_are_told_with_their_magnitudes(page: Any) -> None:
    page.check("#marks")
    line(page, "write CaptureAndProcess")
    page.wait_for_selector("#picture >> text=/found, .* of them known/")
    page.wait_for_function(f"() => ({GREEN})() > 50")
    before = page.evaluate(GREEN)
    page.check("#magnitudes")
    # A picture that comes meanwhile has nothing to be seen until it is read.
    page.wait_for_function(f"() => ({GREEN})() > {before}")


def test_a_picture_goes_over_the_wire_both_ways(page: Any, tmp_path: Path) -> None:
    picture = np.random.default_rng(1).integers(0, 2, (512, 1024), np.uint8) * 200
    picture[40:] = 0  # black blocks are not sent
    sent = tmp_path / "sent.png"
    save_picture(picture, sent)
    page.select_option("#speed", "fast")
    page.set_input_files("#upload", sent)
    page.wait_for_selector("#transfer-told >> text=/^upload: .* done$/")
    page.click("#download")
    page.wait_for_function("() => document.querySelector('#progress').value > 20")
    page.click("#hold")
    page.wait_for_selector("#transfer-told >> text=/ held$/")
    page.click("#hold")
    page.wait_for_selector("#transfer-told >> text=/^download: 4096 of 4096 blocks, done$/")
    with page.expect_download() as saving:
        page.click("#carried")
    saving.value.save_as(tmp_path / "back.png")
    assert np.array_equal(np.asarray(Image.open(tmp_path / "back.png")), picture)
    page.click("#download")
    page.wait_for_selector("#transfer-told >> text=/^download: .* on its way/")
    page.click("#give-up")
    page.wait_for_selector("#transfer-told >> text=/given up after/")
    page.select_option("#speed", "1")
    look(page, "CubeSense")
    assert page.locator("#upload").is_disabled()
    assert "takes no picture" in page.inner_text("#transfer-told")
    assert page.locator("#source option").all_inner_texts() == ["sram1", "sram2"]


def test_a_command_has_its_effect(page: Any) -> None:
    page.select_option("#frame", "DetectionThresholdValues")
    page.select_option("#command", "setDetectionThresholds")
    page.fill("[name=DetectionThreshold]", "33")
    page.fill("[name=StarThreshold]", "34")
    page.click("#send")
    page.wait_for_function("() => document.querySelector('#telemetry').innerText.includes('33')")
    page.check("[title='plot DetectionThreshold']")
    page.wait_for_selector("#plot canvas")


def test_mistakes_are_told_as_text(page: Any) -> None:
    told = line(page, "read <img/src=x/onerror=document.hacked=1>")
    assert "<img" in told
    assert page.locator("#lines li.bad").count() == 1
    assert page.evaluate("document.hacked") is None
    assert page.locator("#lines img").count() == 0


def test_it_tells_what_was_chosen(page: Any) -> None:
    assert "seed 5" in page.inner_text("#chosen")


def test_time_is_paused_stepped_and_goes_on(page: Any) -> None:
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=true]")
    page.click("#step")
    page.wait_for_selector("#lines li.good >> text=step")
    page.fill("#to", "5000")
    page.click("#go")
    page.wait_for_function("() => document.querySelector('#time').textContent.startsWith('5000.0')")
    page.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=false]")


def test_it_goes_back_to_a_snapshot(page: Any) -> None:
    """What was commanded after it is undone, and the line stays open."""
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
    assert "Threshold1: 7" in line(page, "read Configuration")


def test_the_recording_can_be_saved_and_replayed(page: Any, tmp_path: Path) -> None:
    look(page, "CubeSense")
    line(page, "read Identification")
    with page.expect_download() as saving:
        page.click("#recording")
    saved = tmp_path / saving.value.suggested_filename
    saving.value.save_as(saved)
    assert saved.name == "cubesense.rec"
    call = [sys.executable, "-m", "cubestack", "replay", str(saved)]
    assert subprocess.run(call, stdout=subprocess.DEVNULL).returncode == 0


def test_a_fault_is_injected_and_seen(page: Any) -> None:
    faults = page.locator("#fault option").all_inner_texts()
    reset = next(fault for fault in faults if fault.startswith("processor-reset "))
    page.select_option("#fault", reset)
    page.click("#inject")
    page.wait_for_selector(f"#lines li >> text=/ s {reset}: /")


def test_two_tabs_see_the_same(chromium: Any, address: str, page: Any) -> None:
    other = opened(chromium, address)
    page.click("#pause")
    other.wait_for_selector("#pause[aria-pressed=true]")
    other.click("#pause")
    page.wait_for_selector("#pause[aria-pressed=false]")
    other.context.close()


def test_two_tabs_look_at_what_they_like(chromium: Any, address: str, page: Any) -> None:
    other = opened(chromium, address)
    look(other, "CubeSense")
    page.select_option("#band", "IDMode.Mode")
    page.click("#add-band")
    other.select_option("#band", "NadirSearchMode.Search")
    other.click("#add-band")
    page.wait_for_selector("#timeline-told >> text=/IDMode.Mode [A-Z]/")
    other.wait_for_selector("#timeline-told >> text=/NadirSearchMode.Search [A-Z]/")
    assert "Nadir" not in page.inner_text("#timeline-told")
    assert other.locator("#supplies li").count() > page.locator("#supplies li").count()
    other.context.close()


def test_the_view_can_be_reached_by_tab(page: Any) -> None:
    """Every control of the live view, in the order of the page, and none holds the focus."""
    page.wait_for_selector("#sphere:visible")
    page.focus("#picture-name")
    reached = list[str]()
    for _ in range(80):
        reached.append(page.evaluate("document.activeElement.id"))
        page.keyboard.press("Tab")
    sought = ("magnitudes", "frame-of-picture", "sphere", "band", "add-band", "lamps-ErrorFlags")
    at = [reached.index(name) for name in sought]
    assert at == sorted(at)


def test_the_keyboard_is_enough(page: Any) -> None:
    page.focus("#newest")
    for _ in range(150):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "pause":
            break
    page.keyboard.press("Enter")
    page.wait_for_selector("#pause[aria-pressed=true]")
    page.keyboard.press("Space")
    page.wait_for_selector("#pause[aria-pressed=false]")


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_is_cut_off_covered_or_pale(
    chromium: Any, address: str, width: int, scheme: str
) -> None:
    size = {"width": width, "height": 850}
    page = opened(chromium, address, viewport=size, color_scheme=scheme)
    for device in ("AraMiS", "CubeSense", "CubeStar"):
        look(page, device)
        page.click("#add-band")
        page.wait_for_selector("#timeline-legend li")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(COVERED) == []
        assert page.evaluate(PALE) == []
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 28)"
    assert dark == (scheme == "dark")
    page.context.close()


@pytest.mark.parametrize("device", ["AraMiS", "CubeSense", "CubeStar"])
def test_every_message_has_its_form_or_table(page: Any, device: str) -> None:
    look(page, device)
    for chooser, shown in (("#command", "#commands form"), ("#frame", "#telemetry table")):
        names = page.locator(f"{chooser} option").all_inner_texts()
        assert len(names) > 10
        for name in names:
            page.select_option(chooser, name)
            assert page.locator(shown).first.is_visible()
    assert "Identification" in line(page, "list")
