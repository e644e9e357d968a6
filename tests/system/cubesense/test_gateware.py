import pytest

from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense import fpga
from cubestack.firmware_model.interface.cubesense.codes import Camera, DetectResult, Sram
from tests.system.conftest import Open

from .conftest import FACING

DARK = EarthSunScene(nadir=(1, 0, 0), sun=(0, 0, 1))


@pytest.mark.parametrize("gateware", ["as-flown", "corrected"])
def test_coordinates_after_the_sun_disappears(ready: Open, gateware: str) -> None:
    with ready(FACING, profile="published", set=f"gateware={gateware}") as opened:
        assert opened.client.capture_and_detect(Camera.SUN).detected
        seen = opened.board.program.state.results[Camera.SUN].first
        opened.scene = DARK
        opened.wait(0.2)
        found = opened.client.capture_and_detect(Camera.SUN)
        assert found.detect is DetectResult.SUN_NOT_FOUND
        first = opened.board.program.state.results[Camera.SUN].first
        assert first == (seen if gateware == "as-flown" else fpga.SUN_NOT_FOUND)


@pytest.mark.parametrize("camera", Camera)
def test_single_search_gateware_gives_the_same_direction(ready: Open, camera: Camera) -> None:
    other, found, took_s = Sram(1 - camera), {}, {}
    for gateware in ("one-search", "corrected"):
        switches = f"lens=nominal,gateware={gateware}"
        with ready(FACING, profile="published", set=switches) as opened:
            own = opened.board.engine.memories[camera.name.lower()]
            before, began_s = own.copy(), opened.time_s
            found[gateware] = opened.client.capture_and_detect(camera, other)
            took_s[gateware] = opened.time_s - began_s
            assert found[gateware].detected
            assert (own == before).all(), "nothing is written into the memory of the sender"
    one, usual = found["one-search"], found["corrected"]
    assert (one.alpha_deg, one.beta_deg) == (usual.alpha_deg, usual.beta_deg)
    expected_s = {Camera.SUN: 0.87, Camera.NADIR: 13.93}[camera]
    assert took_s["one-search"] == pytest.approx(expected_s, abs=0.4)
    assert took_s["corrected"] < 0.3
