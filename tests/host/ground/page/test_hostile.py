from collections.abc import Iterator
from typing import Any

import pytest

from ..browser import HOSTILE, hostile, line, lives, look, shown

pytestmark = [pytest.mark.xdist_group("page hostile"), pytest.mark.slow]

DEVICES = ("cubestar", "cubesense")


@pytest.fixture
def page(chromium: Any, address: str) -> Iterator[Any]:
    """The page, of which no test runs a script."""
    with shown(chromium, address) as opened:
        yield opened
        assert opened.locator("img, script:not([src])").count() == 0
        assert opened.evaluate("document.hacked") is None


@pytest.mark.parametrize("missing", [True, False])
def test_device_texts_are_escaped(page: Any, missing: bool) -> None:

    def told(route: Any) -> None:
        abouts = [hostile(one) for one in route.fetch().json()]
        for about in abouts:
            names = [*about["missing"], "controls", "raw", "results", "download", "registers"]
            about["missing"] = dict.fromkeys(names, HOSTILE) if missing else {}
        route.fulfill(json=abouts)

    page.route("**/targets", told)
    page.route("**/shell", lambda route: route.fulfill(json={"rows": [[HOSTILE, HOSTILE]]}))
    page.reload()
    page.wait_for_selector(f"nav >> text={HOSTILE}")
    for number in (0, 1):
        page.locator("nav button").nth(number).click()
        page.wait_for_selector("#take")
        line(page, HOSTILE)
        for chooser in ("#command", "#frame"):
            for option in page.locator(f"{chooser} option").all_inner_texts()[:5]:
                page.select_option(chooser, option)


def test_live_texts_are_escaped(page: Any) -> None:

    def change(told: dict[str, Any]) -> dict[str, Any]:
        made = hostile(told) | {"log": [HOSTILE]}
        made["values"] = {
            frame: dict.fromkeys(values, HOSTILE)
            for frame, values in told.get("values", {}).items()
        }
        return made

    look(page, "CubeStar")
    page.click("#snapshot")
    page.wait_for_selector("#lines li.good >> text=snapshot")
    lives(page, change)
    for place in ("#lines li", "#results td", "#summary", "#supplies li", "#state"):
        page.locator(place).filter(has_text=HOSTILE).first.wait_for(state="attached")
    page.locator("#telemetry td").filter(has_text=HOSTILE).first.wait_for(state="attached")
    for chooser in ("#snapshots option", "#picture-name option"):
        page.locator(chooser).filter(has_text=HOSTILE).first.wait_for(state="attached")


def test_live_errors_are_escaped(page: Any) -> None:
    def change(told: dict[str, Any]) -> dict[str, Any]:
        transfer = {"what": HOSTILE, "done": 1, "total": 2, "paused": False, "ended": HOSTILE}
        return {
            "link": told["link"] | {"failed": 1, "broken": True, "error": HOSTILE},
            "transfer": transfer | {"saved": False},
            "playback": None,
            "values": {frame: {"error": HOSTILE} for frame in told.get("values", {})},
            "results": {"error": HOSTILE},
            "emulation": {"error": HOSTILE},
        }

    lives(page, change)
    for place in ("#link-health", "#transfer-status", "#telemetry p", "#summary", "#state"):
        page.locator(place).filter(has_text=HOSTILE).first.wait_for(state="attached")
    page.locator("#attitude-status").filter(has_text=HOSTILE).wait_for(state="attached")


def test_answers_are_escaped(page: Any) -> None:
    look(page, "CubeStar")
    answer = {"value": HOSTILE, "bits": {HOSTILE: HOSTILE}}
    page.route("**/sensor-registers/*", lambda route: route.fulfill(json=answer))
    page.click("#read-sensor")
    page.click("#settings summary >> text=image sensor register")
    page.locator("#sensor-rows td").filter(has_text=HOSTILE).first.wait_for(state="attached")
    star = {"x": 500, "y": 200, "name": HOSTILE, "v_mag": 1.0}
    page.route("**/detections/*", lambda r: r.fulfill(json={"marks": [star], "lines": []}))
    page.uncheck("#detections")
    page.check("#detections")
    page.wait_for_selector("#picture >> text=/1 detected, 1 identified/")
    before = page.inner_text("#time")
    page.wait_for_function(
        "before => document.querySelector('#time').textContent !== before", arg=before
    )
    assert page.inner_text("#found") == "1 detected, 1 identified"  # updates leave it
    for path in ("shell", "pause", "sensor-registers/*", "detections/*", "download"):
        page.route(f"**/{path}", lambda route: route.fulfill(status=400, json={"error": HOSTILE}))
    before = page.locator("#lines li.bad").count()
    page.click("#pause")
    page.click("#download")
    page.click("#read-sensor")
    line(page, "help")
    bad = page.locator("#lines li.bad").filter(has_text=HOSTILE)
    bad.nth(before + 3).wait_for(state="attached")
    page.uncheck("#detections")
    page.check("#detections")
    page.locator("#caption").filter(has_text=HOSTILE).first.wait_for(state="attached")


def test_scene_and_snapshot_names_are_escaped(page: Any) -> None:
    page.click("#scene summary >> text=scene file")
    page.fill("#scene-text", f"kind = '{HOSTILE}'")
    page.click("#apply-file")
    page.locator("#lines li.bad").filter(has_text=HOSTILE).wait_for(state="attached")
    path = "/targets/0/snapshot"
    page.evaluate(
        "([path, name]) => fetch(path, {method: 'POST', body: JSON.stringify({name})})",
        [path, HOSTILE],
    )
    page.locator("#snapshots option").filter(has_text=HOSTILE).wait_for(state="attached")
