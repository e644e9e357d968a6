"""Devices on one satellite: what their cameras see follows its orbit, in virtual time."""

from collections.abc import Generator, Sequence
from typing import Any

from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.orbit import Orbit
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.host.emulation.emulated import AnyEmulated

INTERVAL_S = 0.125
"""Virtual time from one look at the orbit to the next.

Between two looks the body turns evenly and the Earth stands still, which in a low orbit is off by
half an interval's 0.06 deg/s at most: 0.004 deg, far below what a sun and nadir sensor resolves.
"""


def follow(orbit: Orbit, devices: Sequence[AnyEmulated]) -> None:
    """Have all ``devices``, which share their virtual time, see what there is on ``orbit``.

    ValueError names a device that looks at neither sky nor Earth, a mounting without a device, and
    elements that hold no orbit.
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
    """What a device sees from now on, with all else of its scene as it is."""
    given = device.scene
    scene = getattr(given, "scene", given)  # a view's
    if isinstance(scene, SkyScene):
        return orbit.sky(device.time_s, scene, device.device.name)
    if isinstance(scene, EarthSunScene):
        return orbit.below(device.time_s, scene, INTERVAL_S)
    raise ValueError(f"{device.device.name} looks at a picture, which follows no orbit")
