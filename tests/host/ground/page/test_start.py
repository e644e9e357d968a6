from collections.abc import Iterator
from typing import Any

import pytest

from cubestack.firmware_model.reference.image import reference_image

from ..browser import STARTED_MS, await_devices, shown, station
from .test_scene import fill

pytestmark = pytest.mark.xdist_group("other pages")


@pytest.fixture(scope="module")
def address(chromium: Any) -> Iterator[str]:
    with station("emulated:cubestar", "--seed", "5") as opened:
        await_devices(chromium, opened)
        yield opened


def runs(page: Any, text: str) -> None:
    page.wait_for_selector(f"#start-status >> text={text}", timeout=STARTED_MS)


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
        page.wait_for_selector(done, timeout=STARTED_MS)
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
