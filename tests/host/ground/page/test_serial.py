import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from ..browser import line, shown, station
from ..cable import BAUD, cable, recorded_uart

pytestmark = [
    pytest.mark.xdist_group("other pages"),
    pytest.mark.skipif(shutil.which("socat") is None, reason="socat is not installed"),
]

DEVICE = "cubesense"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return recorded_uart(DEVICE, tmp_path_factory.mktemp("recorded"))


@contextmanager
def opened(chromium: Any, port: Path, *words: str) -> Iterator[Any]:
    """The page of the device at ``port``."""
    with (
        station(str(port), "--device", DEVICE, *words) as address,
        shown(chromium, address) as page,
    ):
        yield page


def cell(page: Any, field: str) -> Any:
    return page.locator("#telemetry tr", has=page.locator(f"th >> text=/^{field}$/")).locator("td")


@pytest.mark.slow
def test_live_values_are_read_over_the_line(chromium: Any, tmp_path: Path, recorded: Any) -> None:
    with (
        cable(tmp_path / "ours", tmp_path / "theirs", recorded),
        opened(chromium, tmp_path / "ours") as page,
    ):
        for name in ("Identification", "Configuration"):
            page.select_option("#frame", name)
            values = recorded.node.told[name]
            field = next(one.name for one in recorded.node.interface.telemetry(name).fields)
            shows = cell(page, field).first
            shows.filter(has_text=str(values[field])).wait_for(state="attached")
        assert f"Threshold1: {values['Threshold1']}" in line(page, "read Configuration")
        assert str(tmp_path / "ours") in page.inner_text("#link")
        assert " 0 failed" in page.inner_text("#link-health")
        assert page.locator("#pause").is_disabled()
        assert "no control port" in page.locator("#pause").get_attribute("title")


@pytest.mark.slow
def test_wrong_baud_rate_is_reported(chromium: Any, tmp_path: Path, recorded: Any) -> None:
    with (
        cable(tmp_path / "ours", tmp_path / "theirs", recorded),
        opened(chromium, tmp_path / "ours", "--baud", "19200") as page,
    ):
        told = f"it answers at {BAUD} baud, and this is 19200"
        page.locator("#link-health.bad").filter(has_text=told).wait_for(state="attached")
        assert told in line(page, "read Configuration")


@pytest.mark.slow
def test_page_recovers_from_an_unplugged_cable(
    chromium: Any, tmp_path: Path, recorded: Any
) -> None:
    ends = tmp_path / "ours", tmp_path / "theirs"
    with cable(*ends, recorded):
        opening = opened(chromium, ends[0])
        page = opening.__enter__()
        page.evaluate("window.here = true")
        page.select_option("#frame", "Configuration")
        value = recorded.node.told["Configuration"]["Threshold1"]
        shows = cell(page, "Threshold1").first
        shows.filter(has_text=str(value)).wait_for(state="attached")
    try:
        page.wait_for_selector("#link.bad")
        shows.filter(has_not_text=str(value)).wait_for(state="attached")
        assert str(ends[0]) in page.inner_text("#link-health")
        recorded.node.told["Configuration"] |= {"Threshold1": value - 5}
        with cable(*ends, recorded):
            shows.filter(has_text=str(value - 5)).wait_for(state="attached")
            page.wait_for_selector("#link:not(.bad)")
            assert page.evaluate("window.here")
    finally:
        recorded.node.told["Configuration"] |= {"Threshold1": value}
        opening.__exit__(None, None, None)
