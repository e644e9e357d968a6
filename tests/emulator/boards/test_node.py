from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.boards.node import I2cCameraBus, NodeBoard, NodePeripherals
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.camera.mt9m001.sensor import Mt9m001
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.power import Part, PowerTable
from cubestack.emulator.sim.virtual_time import PS_PER_MS, Kernel
from cubestack.firmware_model.interface.checks import SensorError
from cubestack.firmware_model.interface.codec.field import u16
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.node_messages import node_interface
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import CostTable
from cubestack.firmware_model.mcu.requests import CameraTransfer, ReadPin, Routine, SetPin
from cubestack.firmware_model.node.program import Action, NodeProgram, Source
from cubestack.host.clients.node import NodeClient

INTERFACE = node_interface(
    "Plain",
    i2c_address=0x30,
    telecommands=[Message(10, "Double", "set the lamp to twice the level")],
    telemetries=[Message(140, "Level", "that was read").of(u16("Counts", "of the converter"))],
)


class Doubler(NodeProgram):
    interface = INTERFACE
    level = 0

    def actions(self) -> Mapping[str, Action]:
        return {"Double": self._double}

    def sources(self) -> Mapping[str, Source]:
        return {"Level": lambda: {"Counts": self.level}}

    def _double(self, _parameters: dict[str, Any]) -> Routine[None]:
        self.level = yield ReadPin("CONVERTER")
        yield SetPin("LAMP", 2 * self.level)


class DoublerBoard(NodeBoard[Doubler, int]):
    program_type = Doubler
    scene_type = int
    costs = CORTEX_M3
    supplies = PowerTable(3.3, {"processor": Part(None, {"sleep": 1.0, "run": 2.0})}, {})
    lamp = 0

    def inputs(self) -> Mapping[str, Callable[[], int]]:
        return {"CONVERTER": lambda: self.scene}

    def outputs(self) -> Mapping[str, Callable[[int], None]]:
        return {"LAMP": lambda level: setattr(self, "lamp", level)}


def test_processor_pins_reach_the_board() -> None:
    board = DoublerBoard(21)
    node = NodeClient(board.serial(), INTERFACE)
    node.command("Double")
    node.wait_processed(1.0)
    assert (node.telemetry("Level"), board.lamp) == ({"Counts": 21}, 42)
    board.scene = 70_000
    node.command("Double")
    with pytest.raises(SensorError, match="telemetry 140 Level, field Counts: 70000 does not fit"):
        node.telemetry("Level")


def test_checking_a_program_leaves_the_board_unchanged() -> None:
    checked, unchecked = DoublerBoard(1, seed=5), DoublerBoard(1, seed=5)
    unchecked.rng.random()
    assert checked.processor.meter.total == 0
    assert checked.rng.random() != unchecked.rng.random()


def test_cost_table_without_required_operations_is_rejected() -> None:
    class Poor(DoublerBoard):
        costs = CostTable("slow", 1_000_000, {"port_read": CORTEX_M3.operations["port_read"]})

    with pytest.raises(SensorError, match="costs of slow need host_message, i2c_interrupt, port_w"):
        Poor(1)


@pytest.mark.parametrize(
    ("request_", "bits"),
    [
        # start; address and three bytes, an acknowledge each; stop
        (CameraTransfer(b"abc"), 1 + 4 * 9 + 1),
        # start; address and the register; repeated start; address again and two bytes; stop
        (CameraTransfer(b"r", 2), 1 + 2 * 9 + 1 + 3 * 9 + 1),
    ],
)
@pytest.mark.parametrize("hz", [100_000, 400_000])
def test_camera_transfer_takes_the_time_of_its_bits(
    request_: CameraTransfer, bits: int, hz: int
) -> None:
    camera = Mt9m001(SkyScene.pointing(80.0, 0.0))
    bus = I2cCameraBus(camera, 0x5D, hz)
    assert bus.transfer_ps(request_) == bits * 10**12 // hz


def test_a_camera_answers_to_its_own_address_only() -> None:
    camera = Mt9m001(SkyScene.pointing(80.0, 0.0))
    version = CameraTransfer(b"\x00", 2)
    assert I2cCameraBus(camera, 0x5D, 100_000).transfer(version, 0) == b"\x84\x31"
    assert I2cCameraBus(camera, 0x5D, 100_000).transfer(CameraTransfer(b"\x00"), 0) == b""
    assert I2cCameraBus(camera, 0x5C, 100_000).transfer(version, 0) is None


def test_node_peripherals_expose_uptime_backlog_and_wake() -> None:
    kernel, woken = Kernel(), []
    uart = Uart(kernel, 10_000, lambda _byte: None, lambda: None, silence_bytes=100)
    processor = SimpleNamespace(wake=lambda: woken.append(kernel.now))
    board: Any = SimpleNamespace(kernel=kernel, uart=uart, processor=processor)
    hardware: Any = NodePeripherals(board)  # type: ignore[abstract]
    kernel.advance_to(3 * PS_PER_MS // 2)
    assert hardware.uptime_us() == 1500
    hardware.uart_send(b"abcde")
    assert hardware.uart_backlog() == uart.backlog == 5
    kernel.advance_to(kernel.now + 3 * PS_PER_MS)
    assert hardware.uart_backlog() == uart.backlog < 5
    hardware.wake()
    assert woken == [kernel.now]
