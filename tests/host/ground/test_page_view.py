from typing import Any

import pytest

from tests.tiers import quick

from .browser import look, shown
from .layout_checks import COVERED, LOOKS, PALE

pytestmark = pytest.mark.xdist_group("page")  # beside others: one browser


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
def test_layout_and_contrast(chromium: Any, address: str, scheme: str, width: int) -> None:
    size = {"width": width, "height": 850}
    with shown(chromium, address, viewport=size, color_scheme=scheme) as page:
        for device in ("AraMiS", "CubeSense", "CubeStar"):
            look(page, device)
            page.click("#add-band")
            page.wait_for_selector("#timeline-legend li")
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.evaluate(COVERED) == []
            assert page.evaluate(PALE) == []
        dark = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 28)"
        assert dark == (scheme == "dark")
