import json
from pathlib import Path

import pytest

from cubestack.firmware_model.interface.codec.switches import PROFILES, Switches
from cubestack.host.devices.registry import device, device_names
from cubestack.host.export.interface import render_switches

from ...conftest import Run

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "switches.md"
WITH_SWITCHES = [name for name in device_names() if device(name).switches.declared()]


@pytest.mark.parametrize("name", WITH_SWITCHES)
def test_page_table_is_up_to_date(name: str) -> None:
    table = render_switches(device(name).title, device(name).switches, "markdown")
    hint = f"paste `cubestack registers {name} --switches --format markdown` into {PAGE}"
    assert table in PAGE.read_text(encoding="utf-8"), hint


@pytest.mark.parametrize("name", WITH_SWITCHES)
def test_each_format_describes_each_switch(name: str, run: Run) -> None:
    declared = device(name).switches.declared()
    listed = json.loads(run("registers", name, "--switches", "--format", "json").out)
    assert list(listed) == list(declared)
    text = " ".join(run("registers", name, "--switches").out.split())
    for one, switch in declared.items():
        assert [listed[one][profile] for profile in PROFILES] == list(switch.choices[:2])
        assert listed[one]["source"] == switch.source
        for part in (one, switch.meaning, switch.source, switch.reason, *switch.choices):
            assert part in text


def test_device_without_switches() -> None:
    assert render_switches("Glow", Switches, "table") == "Glow has no switches\n"
