"""The board of a plain node: pins of its processor, and checks of its declaration."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from cubestack.emulator.boards.node import NodeBoard
from cubestack.emulator.sim.power import Part, PowerTable
from cubestack.firmware_model.interface.checks import SensorError
from cubestack.firmware_model.interface.codec.field import u16
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.node_messages import node_interface
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import CostTable
from cubestack.firmware_model.mcu.requests import ReadPin, Routine, SetPin
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


def test_pins_of_the_processor_lead_to_the_board() -> None:
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


def test_costs_must_have_the_operations_of_every_node() -> None:
    class Poor(DoublerBoard):
        costs = CostTable("slow", 1_000_000, {"port_read": CORTEX_M3.operations["port_read"]})

    with pytest.raises(SensorError, match="costs of slow need host_message, i2c_interrupt, port_w"):
        Poor(1)
