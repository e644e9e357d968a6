import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.reference.image import reference_image

from ..browser import HOSTILE, LOOKS, check_layout, hostile, look, shown

pytestmark = pytest.mark.xdist_group("other pages")

DEVICES = ("cubestar", "cubesense")

INK = (
    "() => { const c = document.querySelector('#sky-map'); const n = new Set();"
    "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
    "for (let i = 0; i < d.length; i += 4) n.add(d[i] << 16 | d[i + 1] << 8 | d[i + 2]);"
    "return n.size }"
)
"""Counts the colours of the map."""

VALUE = "label:has-text('{}') input.scene-value"


@pytest.fixture
def page(chromium: Any, address: str) -> Iterator[Any]:
    with shown(chromium, address) as opened:
        stage(opened, "CubeStar")
        yield opened


def stage(page: Any, device: str) -> None:
    """Shows a device and waits for its scene."""
    look(page, device)
    page.wait_for_selector("#scene-status >> text=/camera/")


def value(page: Any, key: str) -> float:
    return float(page.input_value(f"#scene-keys {VALUE.format(key)} >> nth=0"))


def fill(page: Any, key: str, text: str) -> None:
    page.fill(f"#scene-keys {VALUE.format(key)} >> nth=0", text)


def told(page: Any, text: str) -> None:
    page.wait_for_selector(f"#scene-status >> text={text}")


def place(page: Any, right: float, down: float) -> dict[str, float]:
    """A position on the map, in shares of half its width and height."""
    box = page.locator("#sky-map").bounding_box()
    half = (box["width"] - 16) / 2
    return {"x": box["width"] / 2 + right * half, "y": box["height"] / 2 + down * half / 2}


def click(page: Any, right: float, down: float) -> None:
    """Clicks on the map; repeats the click if the map moved meanwhile."""
    sky_map = page.locator("#sky-map")
    sky_map.scroll_into_view_if_needed()
    before = None
    while before != sky_map.bounding_box():
        before = sky_map.bounding_box()
        sky_map.click(position=place(page, right, down))


def point(page: Any, right: float, down: float) -> None:
    page.hover("#sky-map", position=place(page, right, down))


@pytest.mark.slow
def test_click_and_drag_set_the_pointing(page: Any) -> None:
    click(page, 0, 0)
    told(page, "/camera (0.0|360.0)° -?0.0°/")
    assert min(value(page, "ra_deg"), 360 - value(page, "ra_deg")) < 0.5
    point(page, -0.5, 0)
    page.mouse.down()  # east is left; on the equator a place is at 2 sqrt(2) sin(ra / 4)
    assert value(page, "ra_deg") == pytest.approx(4 * math.degrees(math.asin(8**-0.5)), abs=0.6)
    point(page, -0.4, -0.5)
    point(page, 0, -0.5)
    page.mouse.up()
    # Hammer's projection: half way up the middle is where sqrt(2) sin(dec / 2) is a half of 1.
    expected = 2 * math.degrees(math.asin(0.5 / math.sqrt(2)))
    told(page, "/camera .* 4[012][.]/")
    assert value(page, "dec_deg") == pytest.approx(expected, abs=0.6)
    before = value(page, "ra_deg")
    click(page, -0.95, -0.95)  # beside the map
    assert value(page, "ra_deg") == before


@pytest.mark.slow
def test_keys_set_the_pointing_of_the_emulation(page: Any) -> None:
    fill(page, "ra_deg", "100")
    fill(page, "dec_deg", "10")
    told(page, "/camera 100.0° 10.0°/")
    page.focus("#sky-map")
    page.keyboard.press("ArrowLeft")  # east
    page.keyboard.press("Shift+ArrowDown")
    told(page, "/camera 101.0° 0.0°/")
    fill(page, "roll_deg", "45")
    page.press("#scene-apply", "Enter")
    page.wait_for_selector("#lines li.good >> text=scene")
    page.select_option("#command", "CaptureAndProcess")
    page.click("#send")
    page.wait_for_selector("#attitude-status >> text=/truth 101.0000° .*0.0000° 45.0000°/")


@pytest.mark.slow
def test_rejected_value_is_shown_at_its_field(page: Any) -> None:
    fill(page, "ra_deg", "400")
    told(page, "scene: ra_deg must be -360 to 360 deg, not 400")
    field = page.locator(f"#scene-keys {VALUE.format('ra_deg')}").first
    assert field.get_attribute("aria-invalid") == "true"
    page.click("#scene-apply")
    page.wait_for_selector("#lines li.bad >> text=scene: ra_deg must be -360 to 360 deg, not 400")
    page.click("#scene-load")
    told(page, "/^right ascension/")
    assert field.get_attribute("aria-invalid") is None


@pytest.mark.slow
def test_form_fields_match_the_scene_keys(page: Any) -> None:
    epoch = page.locator(f"#scene-keys {VALUE.format('epoch')}")
    assert (epoch.get_attribute("min"), epoch.get_attribute("max")) == ("1800", "2200")
    assert epoch.get_attribute("placeholder") == "2026"
    epoch.focus()
    assert "Julian year" in page.inner_text("#scene-help")
    kinds = page.locator("[aria-label='kind of hazards'] option").all_text_contents()
    assert {"moon", "earth-limb", "hot-pixels"} <= set(kinds)
    page.select_option("#scene-kind", "picture")
    told(page, "needs the key file")
    assert page.locator("#scene-keys label:has-text('exposure_ms')").count() == 1


@pytest.mark.slow
def test_hazard_is_added_moved_and_removed(page: Any) -> None:
    page.click("#scene-keys summary >> text=hazards")
    page.select_option("[aria-label='kind of hazards']", "moon")
    page.click("[aria-label='add to hazards']")
    told(page, "/Moon /")
    things = page.locator("#scene-what option").all_inner_texts()
    assert things == ["pointing", "moon.direction", "moon.sun"]
    page.select_option("#scene-what", "moon.direction")
    click(page, 0, 0)
    told(page, "/Moon (0.0|360.0)°/")
    page.click("#scene-apply")
    page.wait_for_selector("#lines li.good >> text=scene")
    page.click("#scene-load")
    told(page, "/Moon (0.0|360.0)°/")
    page.click("[aria-label='remove moon']")
    told(page, "/camera [^;]*$/")
    page.click("#scene-apply")
    page.wait_for_function("() => document.querySelectorAll('#lines li.good').length >= 2")


@pytest.mark.slow
def test_scene_file_text_is_applied(page: Any) -> None:
    page.click("#scene summary >> text=scene file")
    page.fill("#scene-text", 'kind = "sky"\nra_deg = 200.0\ndec_deg = -40.0\n')
    page.click("#apply-file")
    told(page, "/camera 200.0° -40.0°/")
    assert value(page, "ra_deg") == 200
    page.fill("#scene-text", "[pointin]\n")
    page.click("#apply-file")
    page.wait_for_selector("#lines li.bad >> text=scene: ")


@pytest.mark.slow
def test_earth_and_moon_are_placed_on_the_map(page: Any) -> None:
    stage(page, "CubeSense")
    assert page.locator("#scene-what option").all_inner_texts() == ["nadir", "sun", "moon"]
    click(page, 0, 0)  # +z, where the nadir camera looks
    told(page, "/Earth -?0.00 -?0.00 1.00/")
    page.select_option("#scene-what", "moon")
    click(page, 0.2, 0)
    told(page, "/Moon/")
    page.click("#scene-apply")
    page.wait_for_selector("#lines li.good >> text=scene")
    page.click("#scene-load")
    told(page, "/Earth -?0.00 -?0.00 1.00.*Moon/")


@pytest.mark.slow
def test_directions_are_compared_with_the_truth(page: Any) -> None:
    stage(page, "CubeSense")
    row = page.locator("#angles tr", has_text="nadir direction")
    for camera, memory in (("NADIR", "SRAM2"), ("SUN", "SRAM1")):
        page.fill("#line", f"write CaptureAndDetect Camera={camera} Sram={memory}")
        page.press("#line", "Enter")
        page.wait_for_selector(f"#results tr:has-text('{camera.lower()} detect') >> text=SUCCESS")
        direction = f"#angles tr:has-text('{camera.lower()} direction')"
        page.wait_for_selector(f"{direction} >> text=/^[0-9.]+[°″]$/")
    texts = row.get_attribute("title").replace("measured ", "").split(", true ")
    answer, truth = (np.array([float(part) for part in one.split()]) for one in texts)
    angle = math.degrees(float(np.linalg.norm(answer - truth)))
    error = row.locator("td").last.inner_text()
    shown_deg = float(error[:-1]) / (3600 if error.endswith("″") else 1)
    assert shown_deg == pytest.approx(angle, abs=0.02)
    assert shown_deg < 1.0
    with page.expect_download() as saving:
        page.click("#save")
    header = saving.value.path().read_text("utf-8").splitlines()[0].split(",")
    assert {"nadir_error_deg", "sun_error_deg", "sun_alpha_error_deg"} <= set(header)


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "width"), LOOKS)
def test_scene_form_fits_the_screen(chromium: Any, address: str, scheme: str, width: int) -> None:
    size = {"width": width, "height": 850}
    with shown(chromium, address, viewport=size, color_scheme=scheme) as page:
        for device in ("CubeStar", "CubeSense"):
            stage(page, device)
            for summary in page.locator("#scene-keys > div > details > summary").all():
                summary.click()
            page.click("[aria-label='add to hazards']")
            check_layout(page, width)
            assert page.evaluate(INK) > 50  # grid, stars or discs, names, outlines


@pytest.mark.slow
def test_scene_keys_are_escaped(chromium: Any, address: str) -> None:
    with shown(chromium, address) as page:

        def evil(route: Any) -> None:
            kinds = route.fetch().json()["kinds"]
            for key in kinds["sky"].values():
                key["meaning"], key["unit"] = HOSTILE, HOSTILE
            number = {"type": "number", "meaning": "", "unit": ""}
            kinds["sky"][HOSTILE] = number | {"default": HOSTILE}
            route.fulfill(json={"kinds": kinds})

        page.route("**/scene/keys", evil)
        page.route("**/stars", lambda route: route.fulfill(json=hostile(route.fetch().json())))
        page.reload()
        page.wait_for_selector("#take")
        stage(page, "CubeStar")
        page.fill(f"[aria-label='{HOSTILE}']", "3")
        told(page, "/unknown key/")
        page.locator(f"#scene-keys {VALUE.format('epoch')}").focus()
        assert HOSTILE in page.inner_text("#scene-help")
        assert page.locator("img").count() == 0
        assert page.evaluate("document.hacked") is None


def runs(page: Any, text: str) -> None:
    page.wait_for_selector(f"#start-status >> text={text}")


@pytest.mark.slow
def test_profile_and_firmware_are_selected(chromium: Any, address: str, tmp_path: Any) -> None:
    with shown(chromium, address) as page, shown(chromium, address) as other:
        runs(page, "running: seed 5, profile published")
        fill(page, "ra_deg", "120")
        page.click("#scene-apply")
        page.wait_for_selector("#lines li.good >> text=scene")
        page.select_option("#option-profile", "extended")
        page.press("#restart", "Enter")
        done = "#lines li.good >> text=/restart.*profile: extended/s"
        page.wait_for_selector(done)
        for tab in (page, other):
            runs(tab, "running: seed 5, profile extended")
            tab.wait_for_selector("#scene-status >> text=/camera 120.0°/")
            tab.wait_for_function("() => document.querySelector('#time').textContent !== ''")
        page.fill("#option-set", "nonsense=1")
        page.click("#restart")
        page.wait_for_selector("#lines li.bad >> text=/restart.*nonsense/s")
        runs(page, "running: seed 5, profile extended")
        page.fill("#option-set", "")
        page.select_option("#option-profile", "published")
        names = page.locator("#option-firmware option").all_inner_texts()
        assert names == ["this project's model", "reference", "upload a file"]
        page.select_option("#option-firmware", names[-1])
        page.click("#restart")
        page.wait_for_selector("#start >> text=firmware: choose a file")
        page.set_input_files("#option-firmware-file", reference_image())
        page.click("#restart")
        runs(page, f"/firmware .*{reference_image().name}#/")
        page.wait_for_selector("#scene-status >> text=/camera 120.0°/")
