"""What a sensor of another distribution imports: tables, firmware, board, scene, measurement.

A sensor is a package with two modules. The first one has the tables and the device, and is loaded
by every list of devices; the second one has all that runs, and is loaded when it is used.
`cubestack new-sensor NAME` writes them, with their tests.

Names are loaded at their first use. Mistakes in a declaration are reported in one line, when the
device is found (tables, I2C address, version) or when it is powered up (actions, sources, costs,
supplies): `SensorError` and `InterfaceError`, both ValueError. Components for gateware are in
`cubestack.hdl.blocks`.

Names stay within a version; `node_device` is given the one that the sensor was written for.
"""

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    # The list of the names, by topic: read by `_topics`, and by type checkers.
    "Tables"
    from cubestack.firmware_model.interface.codec.field import Field as Field
    from cubestack.firmware_model.interface.codec.field import InterfaceError as InterfaceError
    from cubestack.firmware_model.interface.codec.field import bool1 as bool1
    from cubestack.firmware_model.interface.codec.field import byte_array as byte_array
    from cubestack.firmware_model.interface.codec.field import enum8 as enum8
    from cubestack.firmware_model.interface.codec.field import f32 as f32
    from cubestack.firmware_model.interface.codec.field import i16 as i16
    from cubestack.firmware_model.interface.codec.field import u8 as u8
    from cubestack.firmware_model.interface.codec.field import u16 as u16
    from cubestack.firmware_model.interface.codec.field import u32 as u32
    from cubestack.firmware_model.interface.codec.message import Interface as Interface
    from cubestack.firmware_model.interface.codec.message import Message as Message
    from cubestack.firmware_model.interface.codec.node_messages import (
        node_interface as node_interface,
    )

    "Firmware"
    from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533 as BLACKFIN_BF533
    from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3 as CORTEX_M3
    from cubestack.firmware_model.mcu.costs import Cost as Cost
    from cubestack.firmware_model.mcu.costs import CostTable as CostTable
    from cubestack.firmware_model.mcu.costs import Meter as Meter
    from cubestack.firmware_model.mcu.pic18 import PIC18F45K20 as PIC18F45K20
    from cubestack.firmware_model.mcu.requests import AwaitPin as AwaitPin
    from cubestack.firmware_model.mcu.requests import Pay as Pay
    from cubestack.firmware_model.mcu.requests import ReadPin as ReadPin
    from cubestack.firmware_model.mcu.requests import ReadTimer as ReadTimer
    from cubestack.firmware_model.mcu.requests import Reset as Reset
    from cubestack.firmware_model.mcu.requests import Routine as Routine
    from cubestack.firmware_model.mcu.requests import SetPin as SetPin
    from cubestack.firmware_model.mcu.requests import Sleep as Sleep
    from cubestack.firmware_model.mcu.requests import StrobeRead as StrobeRead
    from cubestack.firmware_model.mcu.requests import pause as pause
    from cubestack.firmware_model.node.hardware import NodeHardware as NodeHardware
    from cubestack.firmware_model.node.program import Action as Action
    from cubestack.firmware_model.node.program import NodeProgram as NodeProgram
    from cubestack.firmware_model.node.program import Source as Source

    "Scene"
    from cubestack.emulator.scene.attitude import matrix_from_quaternion as matrix_from_quaternion
    from cubestack.emulator.scene.file import SceneError as SceneError
    from cubestack.emulator.scene.form import CameraField as CameraField
    from cubestack.emulator.scene.form import DeclaredScene as DeclaredScene
    from cubestack.emulator.scene.form import SkyMap as SkyMap
    from cubestack.emulator.scene.hazards.contract import SUN_RADIUS_DEG as SUN_RADIUS_DEG
    from cubestack.emulator.scene.hazards.contract import Body as Body
    from cubestack.emulator.scene.pointing import Pointing as Pointing
    from cubestack.firmware_model.values import Declaration as Declaration
    from cubestack.firmware_model.values import choice as choice
    from cubestack.firmware_model.values import flag as flag
    from cubestack.firmware_model.values import moment as moment
    from cubestack.firmware_model.values import number as number
    from cubestack.firmware_model.values import text as text
    from cubestack.firmware_model.values import vector as vector
    from cubestack.firmware_model.values import whole as whole

    "Board"
    from cubestack.emulator.boards.node import NodeBoard as NodeBoard
    from cubestack.emulator.faults.sites import CameraSite as CameraSite
    from cubestack.emulator.faults.sites import Sites as Sites
    from cubestack.emulator.sim.power import Part as Part
    from cubestack.emulator.sim.power import PowerTable as PowerTable

    "Client and experiment"
    from cubestack.host.clients.contract import DeviceClient as DeviceClient
    from cubestack.host.clients.contract import Progress as Progress
    from cubestack.host.experiments.opener import MeasureOptions as MeasureOptions
    from cubestack.host.experiments.scene_experiment import SceneExperiment as SceneExperiment

    "Device"
    from cubestack.firmware_model.interface.checks import SensorError as SensorError
    from cubestack.host.devices.device import VERSION as VERSION
    from cubestack.host.devices.device import BoardOption as BoardOption
    from cubestack.host.devices.device import ConformanceNotes as ConformanceNotes
    from cubestack.host.devices.device import Device as Device
    from cubestack.host.devices.device import Report as Report
    from cubestack.host.devices.node_device import node_device as node_device

    "FPGA and camera"
    from cubestack.emulator.camera.common.image_sensor import PixelClock as PixelClock
    from cubestack.emulator.camera.common.image_sensor import StreamSegment as StreamSegment
    from cubestack.emulator.rtl.contract import RtlEngine as RtlEngine
    from cubestack.emulator.rtl.wiring import CameraPins as CameraPins
    from cubestack.emulator.rtl.wiring import Level as Level
    from cubestack.emulator.rtl.wiring import MemoryPins as MemoryPins
    from cubestack.emulator.rtl.wiring import Wiring as Wiring
    from cubestack.firmware_model.interface.pins import Pin as Pin
    from cubestack.firmware_model.interface.pins import sram_pins as sram_pins
    from cubestack.hdl.flow.top import Clock as Clock
    from cubestack.hdl.flow.top import Top as Top
    from cubestack.hdl.proofs.properties import acknowledges as acknowledges
    from cubestack.hdl.proofs.properties import idle_is_reset as idle_is_reset
    from cubestack.hdl.proofs.properties import outputs_rest as outputs_rest
    from cubestack.hdl.proofs.properties import starts_in as starts_in
    from cubestack.hdl.proofs.properties import writer_wires as writer_wires
    from cubestack.hdl.proofs.properties import written_is_driven as written_is_driven
    from cubestack.hdl.proofs.prover import Proof as Proof
    from cubestack.hdl.proofs.prover import StuckWire as StuckWire


def _topics() -> Iterator[tuple[str, dict[str, tuple[str, str]]]]:
    """The imports above: topics, each with module and name there, by the name here."""
    tree = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    (block,) = (one.body for one in tree.body if isinstance(one, ast.If))
    found: dict[str, tuple[str, str]] = {}
    for one in block:
        if isinstance(one, ast.ImportFrom):
            found |= {str(name.asname): (str(one.module), name.name) for name in one.names}
        elif isinstance(one, ast.Expr):
            found = {}
            yield ast.literal_eval(one.value), found


TOPICS: Final = dict(_topics())
"""Where each name comes from, by topic."""

_HOMES: Final = {name: home for names in TOPICS.values() for name, home in names.items()}

__all__ = [*_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, own_name = _HOMES[name]
    value = getattr(import_module(module), own_name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
