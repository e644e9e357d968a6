"""Firmware-in-the-loop emulator of CubeSat camera sensors: the public library.

::

    import cubestack

    with cubestack.open_device("cubestar", cubestack.SkyScene.pointing(84, -1)) as device:
        device.client.capture_and_process()
        print(device.client.attitude())

    with cubestack.connect("/dev/ttyUSB0", "cubestar") as cubestar:
        print(cubestar.attitude())

    for frame in cubestack.measure("cubestar", frames=20, mag_limit=3.8):
        print(frame.error_cross_deg)

Everything else is internal, but for ``cubestack.sensor``. Names load on first use, so importing
``cubestack`` does not load the emulator.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final, Literal, overload

if TYPE_CHECKING:
    from cubestack.emulator.boards.aramis.board import AramisBoard
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.faults.plan import Plan, load_plan, parse_plan
    from cubestack.emulator.scene.earth_sun import EarthSunScene
    from cubestack.emulator.scene.sky import PictureScene, SkyScene
    from cubestack.host.clients.aramis.client import Aramis
    from cubestack.host.clients.cubesense.client import CubeSense
    from cubestack.host.clients.cubestar.client import CubeStar
    from cubestack.host.devices.device import BoardOption, Device
    from cubestack.host.devices.registry import device_names, emulated_names
    from cubestack.host.emulation.emulated import AnyEmulated, EmulatedDevice
    from cubestack.host.emulation.firmware import ProgramExit
    from cubestack.host.errors import HostError
    from cubestack.host.experiments.measure import measure
    from cubestack.host.transport.smbus import CubeSMBus

    # For type checkers: the client class by the device's name.
    @overload
    def open_device(
        name: Literal["cubestar"], scene: Any = None, **options: Any
    ) -> EmulatedDevice[CubeStarBoard, CubeStar]: ...
    @overload
    def open_device(
        name: Literal["cubesense"], scene: Any = None, **options: Any
    ) -> EmulatedDevice[CubeSenseBoard, CubeSense]: ...
    @overload
    def open_device(
        name: Literal["aramis"], scene: Any = None, **options: Any
    ) -> EmulatedDevice[AramisBoard, Aramis]: ...
    @overload
    def open_device(name: str, scene: Any = None, **options: Any) -> AnyEmulated: ...
    def open_device(name: str, scene: Any = None, **options: Any) -> Any:
        """Power up a registered device; see ``host.emulation.emulated.open_device``."""

    @overload
    def connect(text: str, device: Literal["cubestar"], *, baud: int | None = None) -> CubeStar: ...
    @overload
    def connect(
        text: str, device: Literal["cubesense"], *, baud: int | None = None
    ) -> CubeSense: ...
    @overload
    def connect(text: str, device: Literal["aramis"], *, baud: int | None = None) -> Aramis: ...
    @overload
    def connect(text: str, device: str | None = None, *, baud: int | None = None) -> Any: ...
    def connect(text: str, device: str | None = None, *, baud: int | None = None) -> Any:
        """The client of the device that ``text`` names; see ``host.targets.connect``."""


__all__ = [
    "Aramis",
    "BoardOption",
    "CubeSMBus",
    "CubeSense",
    "CubeStar",
    "Device",
    "EarthSunScene",
    "EmulatedDevice",
    "HostError",
    "PictureScene",
    "Plan",
    "ProgramExit",
    "SkyScene",
    "__version__",
    "connect",
    "device_names",
    "emulated_names",
    "load_plan",
    "measure",
    "open_device",
    "parse_plan",
]

__version__: Final = version("cubestack")

#: Module of each name, loaded on first use.
_HOMES: Final = {
    "Aramis": "host.clients.aramis.client",
    "BoardOption": "host.devices.device",
    "CubeSMBus": "host.transport.smbus",
    "CubeSense": "host.clients.cubesense.client",
    "CubeStar": "host.clients.cubestar.client",
    "Device": "host.devices.device",
    "EarthSunScene": "emulator.scene.earth_sun",
    "EmulatedDevice": "host.emulation.emulated",
    "HostError": "host.errors",
    "PictureScene": "emulator.scene.sky",
    "Plan": "emulator.faults.plan",
    "ProgramExit": "host.emulation.firmware",
    "SkyScene": "emulator.scene.sky",
    "connect": "host.targets",
    "device_names": "host.devices.registry",
    "emulated_names": "host.devices.registry",
    "load_plan": "emulator.faults.plan",
    "measure": "host.experiments.measure",
    "open_device": "host.emulation.emulated",
    "parse_plan": "emulator.faults.plan",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"cubestack.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
