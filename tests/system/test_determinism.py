from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.emulation.emulated import open_device
from tests.system.conftest import Ear
from tests.tiers import quick

SKY = SkyScene.pointing(84, -1)
EARTH = EarthSunScene.facing(sun_deg=(20, 10), nadir_deg=(-8, 12), rate_deg_s=(0.5, -1.0, 2.0))

VIEWS: dict[str, tuple[Callable[[int], Any], list[str]]] = {
    "cubestar": (
        lambda seed: SkyView(SKY, replace(CONDITION, seed=seed)),
        ["CaptureAndProcess", "Trigger"],
    ),
    "cubesense": (
        lambda seed: EarthSunView(EARTH, FisheyeCondition(hot_pixels=20, seed=seed)),
        [],  # reading results makes others
    ),
}


def run(name: str, seed: int) -> tuple[dict[str, Any], list[bytes]]:
    """Traffic of a few captures and loop turns, and the final memories."""
    view, commands = VIEWS[name]
    with open_device(name, view(seed), seed=seed) as opened:
        ear, client = Ear(opened.board.uart), opened.client.client
        client.pause(0.3)
        for command in commands:
            client.command(command)
            client.pause(1.5)
        for _ in range(8):
            client.pause(0.1)
            for message in client.interface.telemetries:
                client.request(bytes([message.id]))
        return vars(ear), [memory.tobytes() for memory in opened.board.engine.memories.values()]


@pytest.mark.parametrize("name", quick(VIEWS, 1))
def test_same_seed_repeats_the_wire_to_the_picosecond(name: str) -> None:
    first, other = run(name, 1), run(name, 2)
    assert len(first[0]["sent"]) > 150
    assert run(name, 1) == first
    assert all(one != another for one, another in zip(first, other, strict=True))
