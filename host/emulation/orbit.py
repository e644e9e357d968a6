"""Scenes of the devices on one satellite, driven by its orbit in virtual time."""

from collections.abc import Generator, Sequence
from typing import Any

from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.orbit import Orbit
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.host.emulation.emulated import AnyEmulated

INTERVAL_S = 0.125
"""Virtual time between updates of the scenes.

Between updates the body turns evenly and the Earth stands still. In a low orbit the error is at
most 0.004 deg (half an interval at 0.06 deg/s), far below the resolution of a sun and nadir sensor.
"""


def follow(orbit: Orbit, devices: Sequence[AnyEmulated]) -> None:
    """Update the scenes of all ``devices``, which share their virtual time, along ``orbit``.

    Raises ValueError for a device that looks at neither sky nor Earth, a mounting without a device,
    and elements that describe no orbit.
    """
    names = [one.device.name for one in devices]
    for name in orbit.mountings:
        if name not in names:
            raise ValueError(f"mountings: {name!r} is not on board; there are {', '.join(names)}")
    _look(orbit, devices)
    for one in devices:
        one.follows = "an orbit moves its pointing, Earth, Sun and Moon; the rest is as it was put"
    kernel = devices[0].board.kernel
    kernel.process(_following(orbit, devices, kernel))


def _following(
    orbit: Orbit, devices: Sequence[AnyEmulated], kernel: Any
) -> Generator[Any, Any, None]:
    while True:
        yield kernel.timeout(round(INTERVAL_S * PS_PER_S))
        _look(orbit, devices)


def _look(orbit: Orbit, devices: Sequence[AnyEmulated]) -> None:
    for one in devices:
        one.scene = _seen(orbit, one)


def _seen(orbit: Orbit, device: AnyEmulated) -> Any:
    """The device's scene from now on; its other parts stay as they are."""
    given = device.scene
    scene = getattr(given, "scene", given)  # a view's
    if isinstance(scene, SkyScene):
        return orbit.sky(device.time_s, scene, device.device.name)
    if isinstance(scene, EarthSunScene):
        return orbit.earth_sun_scene(device.time_s, scene, INTERVAL_S)
    raise ValueError(f"{device.device.name} looks at a picture, which follows no orbit")
