"""The mode flag, flash and the reduced catalogue as the thesis has them, by switches."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.state import FLASH_ENDURANCE
from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.firmware_model.mcu.memory import FlashStore

from .harness import Harness
from .sky import Sky, error_deg, take

Make = Callable[[str], Harness]


@pytest.fixture
def make(catalogue: StarCatalogue) -> Make:
    """The program with some switches as published."""

    def published(*names: str) -> Harness:
        changes = ",".join(f"{one}={CubeStarSwitches.declared()[one].published}" for one in names)
        return Harness(catalogue, CubeStarSwitches.of("extended", changes))

    return published


def modes(unit: Harness, picture: np.ndarray) -> tuple[int, MatchMode]:
    unit.picture = picture
    unit.command("CaptureAndProcess")
    flag = MatchMode(unit.telemetry("LoopStatus")["ModeFlag"])
    return unit.telemetry("AttitudeQuaternion")["Mode"], flag


def test_published_mode_flag_switches_between_lost_and_tracking(
    make: Make, catalogue: StarCatalogue, sky: Sky, pose: Rotation
) -> None:
    unit, tracking, lost = make("transitions"), MatchMode.TRACKING, MatchMode.LOST_IN_SPACE
    elsewhere = take(catalogue, Rotation.from_euler("x", 60, degrees=True) * pose).picture
    assert modes(unit, sky.picture) == (lost, tracking)
    assert modes(unit, sky.picture) == (tracking, tracking)
    assert modes(unit, elsewhere) == (tracking, lost)  # the attitude is still the one before
    assert not unit.telemetry("AttitudeQuaternion")["Valid"]
    assert modes(unit, elsewhere) == (lost, tracking)
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    assert modes(unit, elsewhere) == (tracking, tracking)
    unit.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
    assert modes(unit, elsewhere) == (lost, tracking)
    unit.power_on()
    assert modes(unit, elsewhere) == (tracking, tracking)


def test_published_profile_writes_quaternion_and_matrix_to_flash_each_time(
    make: Make, sky: Sky
) -> None:
    spent, pages = [], []
    for unit in (make("flash_store"), make()):
        unit.picture = sky.picture
        unit.command("CaptureImage", "DetectStars", "IDStars")
        for _ in range(2):
            before_us = unit.now_us
            unit.command("EstimateAttitude")
            spent.append(unit.now_us - before_us)
        assert unit.flash.writes == {"attitude": 2, "mode": 1}
        pages.append(unit.flash.pages["attitude"])
    # 16 words the page, and once one for the flag; working out the matrix takes 1606 cycles
    assert spent[0] - spent[2] == pytest.approx(2 * 20_000 + 17 * 20 + 1606 / 48, abs=3)
    assert spent[1] - spent[3] == pytest.approx(20_000 + 16 * 20 + 1606 / 48, abs=3)
    assert pages[0][36:] == pages[1]
    stored = Rotation.from_matrix(np.frombuffer(pages[0][:36], "<f4").reshape(3, 3))
    assert error_deg(stored, sky.attitude) < 0.005


def test_worn_out_flash_page_can_only_clear_bits() -> None:
    flash = FlashStore(writes={"attitude": FLASH_ENDURANCE - 1})
    for new, kept in ((b"\x0f\x00", b"\x0f\x00"), (b"\xf1\xff", b"\x01\x00")):
        flash.write("attitude", new, FLASH_ENDURANCE)
        assert flash.read("attitude") == kept


def test_tracking_uses_narrower_catalogue(make: Make, catalogue: StarCatalogue, sky: Sky) -> None:
    spent = []
    for unit in (make("reduction"), make()):
        unit.command("setIDMode", IdMode=IdMode.TRACKING)
        modes(unit, sky.picture)
        before = unit.meter.phases.get("prediction", 0)
        modes(unit, sky.picture)
        spent.append(unit.meter.phases["prediction"] - before)
    cosines = catalogue.vectors @ sky.attitude.inv().as_matrix()[:, 2]
    narrow, wide = ((cosines > np.cos(np.radians(deg))).sum() for deg in (30.3, 35))
    assert spent[0] / spent[1] == pytest.approx(narrow / wide, rel=0.02)
