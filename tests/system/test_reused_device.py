"""One device measures many skies: what it has seen before leaves no trace in a result.

A restart of the program clears what it collects across images: counters, longest times, and the
noise of the last five images from which an AraMiS takes its threshold.
"""

from dataclasses import replace
from typing import Any

import pytest

from cubestack.emulator.camera.common.view import View
from cubestack.emulator.camera.mlx75412 import lens as cubestar_lens
from cubestack.emulator.camera.mt9m001 import lens as aramis_lens
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.emulation.emulated import AnyEmulated, open_device

MEASURE: dict[str, list[tuple[str, dict[str, Any]]]] = {
    "cubestar": [("CaptureAndProcess", {})],
    "cubesense": [("CaptureAndDetect", {"Camera": c, "Sram": c}) for c in (0, 1)],
    "aramis": [("Activate", {}), ("GetAttitude", {})],
}
RESTART: dict[str, list[tuple[str, dict[str, Any]]]] = {
    "cubestar": [("Reset", {})],
    "cubesense": [],
    "aramis": [("Reset", {})],
}

#: Messages and fields of times, counters and resets. Times in an image depend on the moment within
#: the camera's frame at which it began.
OF_TIME = ("Identification", "CommunicationStatus", "LogStatus", "SystemTime", "PhaseTimes")
FIELDS = ("ImageTime", "ImageUptime", "TcmdCount", "TlmCount", "ResetCause")


def views(name: str) -> list[Any]:
    """Skies without noise, which are the same at all times."""
    if name == "cubesense":
        angles = [((10, 5), (5, -9)), ((-30, 2), (12, 3)), ((4, 4), (0, 20))]
        quiet = FisheyeCondition(noise=False)
        scenes = (EarthSunScene.facing(*two, seed=n) for n, two in enumerate(angles))
        return [EarthSunView(scene, quiet) for scene in scenes]
    condition = {"cubestar": cubestar_lens.CONDITION, "aramis": aramis_lens.CONDITION}[name]
    skies = (SkyScene.pointing(*at) for at in ((84.0, -1.0), (200.0, -50.0), (10.0, 40.0)))
    return [View(replace(one, mag_limit=3.8), replace(condition, noise=False)) for one in skies]


def perform(unit: AnyEmulated, steps: list[tuple[str, dict[str, Any]]]) -> None:
    for telecommand, parameters in steps:
        unit.client.client.command(telecommand, **parameters)
        unit.client.client.wait_processed(10.0)


def results(unit: AnyEmulated) -> dict[str, Any]:
    shown = [m for m in unit.device.interface.telemetries if m.supported]
    names = [m.name for m in shown if not m.starts_measurement and not m.name.startswith(OF_TIME)]
    answers = {name: unit.client.client.telemetry(name) for name in names}
    return {
        name: {field: one for field, one in answer.items() if field not in FIELDS}
        for name, answer in answers.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", MEASURE)
def test_used_device_measures_like_a_fresh_one(name: str) -> None:
    sky, *others = views(name)
    with open_device(name) as used, open_device(name) as fresh:
        for other in others:
            used.scene = other
            perform(used, MEASURE[name])
        seen = results(used)
        for telecommand, parameters in RESTART[name]:
            used.client.client.command(telecommand, **parameters)
            used.wait(0.5)
        for unit in (used, fresh):
            unit.scene = sky
            perform(unit, MEASURE[name])
        assert results(used) == results(fresh) != seen
