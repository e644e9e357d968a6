"""What the boards draw in states that their documents measured, and what the parts' sheets say."""

import pytest

from cubestack.emulator.boards.aramis.board import ARAMIS_POWER
from cubestack.emulator.boards.cubesense.board import CUBESENSE_POWER
from cubestack.emulator.boards.cubestar.layouts import CUBESTAR_POWER
from cubestack.emulator.sim.power import PowerModel, PowerTable
from cubestack.emulator.sim.virtual_time import Kernel


def milliwatts(table: PowerTable, on: set[str], **states: str) -> float:
    """Of the whole board with these load switches on, its parts in their first states or these."""
    model = PowerModel(Kernel(), table)
    for channel in table.channels:
        model.switch(channel, channel in on)
    for part, state in states.items():
        model.set_state(part, state)
    return model.current_ma() * table.volts


@pytest.mark.parametrize(
    ("states", "ma"),
    [
        ({}, 71.2),
        ({"imager": "enabled"}, 121.2),
        ({"imager": "enabled", "fpga": "storing", "processor": "run"}, 177.3),
        ({"processor": "run", "memory": "transfer", "fpga": "reading"}, 81.81),
    ],
)
def test_cubestar_power_matches_published_table_6_2(states: dict[str, str], ma: float) -> None:
    found = milliwatts(CUBESTAR_POWER, {"memory", "imager"}, **states)
    assert found == pytest.approx(3.3 * ma, abs=0.01)


def test_cubestar_currents_and_comparator_limits_match_the_documents() -> None:
    parts = CUBESTAR_POWER.parts
    assert parts["leds"].ma["on"] * 3.3 == pytest.approx(396.2 - 350)  # section 6.3
    # Appendix E: 200 uA/MHz running, 50 uA/MHz asleep, at 48 MHz.
    assert parts["processor"].ma == pytest.approx({"sleep": 0.050 * 48, "run": 0.200 * 48})
    for channel, times in (("imager", 4 / 3), ("memory", 10)):
        most = sum(max(part.ma.values()) for part in parts.values() if part.channel == channel)
        assert CUBESTAR_POWER.channels[channel] == pytest.approx(times * most, rel=0.02)


SRAMS, CAMERAS = {"SRAM1", "SRAM2"}, {"sun_camera", "nadir_camera"}
SUN = {"sun_fpga": "imaging", "sram1": "active"}
NADIR = {"nadir_fpga": "imaging", "sram2": "active"}


@pytest.mark.parametrize(
    ("on", "states", "mw", "within"),
    [
        (set(), {"processor": "reset"}, 41.9, 1),
        (set(), {}, 62.2, 1),
        ({"SRAM1"}, {}, 84.2, 1),
        (SRAMS, {}, 108.1, 1),
        (SRAMS | {"sun_camera"}, {}, 246.8, 14),  # two cameras that differ, and two that do not
        (SRAMS | CAMERAS, {}, 359.5, 1),
        (SRAMS | CAMERAS, SUN, 396.4, 1),
        (SRAMS | CAMERAS, NADIR, 396.4, 1),
        (SRAMS | CAMERAS, SUN | NADIR, 432.4, 1),
    ],
)
def test_cubesense_power_matches_published_table_7_1(
    on: set[str], states: dict[str, str], mw: float, within: float
) -> None:
    found = milliwatts(CUBESENSE_POWER, on, **({"processor": "on"} | states))
    assert found == pytest.approx(mw, abs=within)


def test_aramis_camera_draws_data_sheet_power() -> None:
    """MT9M001: 363 mW working, 294 uW in standby."""
    off = milliwatts(ARAMIS_POWER, set())
    for state, mw in (("working", 363), ("standby", 0.294)):
        camera = milliwatts(ARAMIS_POWER, {"camera"}, camera=state) - off
        assert camera == pytest.approx(mw, abs=0.05)
