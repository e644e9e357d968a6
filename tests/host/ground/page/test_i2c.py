import os
import re
from collections.abc import Iterator
from typing import Any

import pytest

from cubestack.host.devices.registry import device
from cubestack.host.emulation.process import emulating

from ..browser import line, shown, station

pytestmark = [pytest.mark.xdist_group("page i2c"), pytest.mark.slow]

BUS = 16 + os.getpid() % 200

REGISTERS = device("cubesense").interface.registers


@pytest.fixture(scope="module")
def address(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Two devices on one bus; one has a node address and a register address."""
    folder = tmp_path_factory.mktemp("run")
    environment = {"XDG_RUNTIME_DIR": str(folder)}
    words = ["cubesense", "cubestar", "--i2c", str(BUS), "--pace", "fast"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)  # links to serial ports are made there
        with emulating(words, environment) as said:
            assert any(re.match(rf"I2C bus {BUS}: ", one) for one in said)
            targets = [f"i2c:{BUS}:{address:#04x}" for address in (0x1B, 0x1A)]
            with station(*targets, environment={**os.environ, **environment}) as opened:
                yield opened


@pytest.fixture
def page(chromium: Any, address: str) -> Iterator[Any]:
    with shown(chromium, address) as opened:
        yield opened


def test_telemetry_and_commands_use_the_bus(page: Any) -> None:
    page.wait_for_selector(f"#link >> text=i2c:{BUS}:0x1b")
    line(page, "write DetectionThreshold1 77")
    page.select_option("#frame", "Configuration")
    page.locator("#telemetry td.value").first.filter(has_text="77").wait_for(state="attached")
    assert "is not a serial line" in page.inner_text("#commands")
    page.click("nav >> text=CubeStar")
    page.wait_for_selector(f"#link >> text=i2c:{BUS}:0x1a")
    assert "NodeType: 5" in line(page, "read Identification")
    assert page.locator("#read-registers").is_disabled()


def test_page_reads_and_writes_registers(page: Any) -> None:
    assert REGISTERS is not None
    named = {one.name: one for one in REGISTERS}
    page.click("#settings summary >> text=/[0-9]+ registers/")
    assert page.locator("#registers-rows tr").count() == len(named)
    told = line(page, "write NADIR_THRESHOLD 0x21")
    assert "done" in told, told
    page.click("#read-registers")
    page.wait_for_selector("#registers-status >> text=/[0-9]+ of [0-9]+ differ/")
    for name, one in named.items():
        row = page.locator("#registers-rows tr", has=page.locator(f"th >> text=/^{name}$/"))
        value, default = row.locator("td").all_inner_texts()[:2]
        assert (value not in ("", "\N{EN DASH}")) == (one.readable and not one.streams), name
        assert (row.get_attribute("class") == "differs") == (
            one.readable and not one.streams and value != default
        )
    changed = page.locator("#registers-rows tr.differs", has_text="NADIR_THRESHOLD")
    assert changed.locator("td").first.inner_text() == str(0x21)
