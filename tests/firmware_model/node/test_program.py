"""The program of a plain node: telecommands in order, settings, flags, what it says of itself."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.interface.codec.field import u8, u16
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.node_messages import AckError, node_interface
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine, Sleep
from cubestack.firmware_model.node.commands import QUEUE_DEPTH
from cubestack.firmware_model.node.program import TELECOMMAND, Action, NodeProgram, Source

from ..cubesense.harness import Harness as CubeSense
from ..cubestar.harness import Harness as CubeStar
from ..host_side import HostSide
from ..runner import Runner

WORK_US = 500

_LEVEL = u8("Level", "a setting", reset=7)
INTERFACE = node_interface(
    "Plain",
    version=3,
    i2c_address=0x30,
    flags={"Overdone": "more than 9 in all"},
    telecommands=(
        Message(10, "Work", "take some time").of(u8("Amount", "to be added", high=9)),
        Message(11, "SetLevel", "set the level").of(_LEVEL),
    ),
    telemetries=(
        Message(140, "Done", "all amounts").of(u16("Sum", "of them")),
        Message(141, "Settings", "what was set").of(_LEVEL),
    ),
)


class Adder(NodeProgram):
    interface = INTERFACE
    total = 0

    def actions(self) -> Mapping[str, Action]:
        return {"Work": self._work}

    def sources(self) -> Mapping[str, Source]:
        return {"Done": lambda: {"Sum": self.total}}

    def _work(self, values: dict[str, Any]) -> Routine[None]:
        now_us: int = yield ReadTimer()
        yield Sleep(now_us + WORK_US, wakeable=False)
        self.total += values["Amount"]
        if self.total > 9:
            self.state.raise_flag("Overdone")


class Node(Runner, HostSide):
    interface = INTERFACE

    def __init__(self) -> None:
        HostSide.__init__(self)
        Runner.__init__(self, CORTEX_M3)
        self._boot()

    def start(self) -> Routine[None]:
        self.program = Adder(self, self.meter)
        return self.program.main()

    @property
    def link(self) -> Any:
        return self.program.link

    def command(self, name: str, **values: object) -> None:
        assert self.send(name, **values) == AckError.OK
        Runner.run(self)


@pytest.fixture
def node() -> Node:
    return Node()


def test_telecommands_are_executed_one_after_the_other(node: Node) -> None:
    for amount in (1, 2, 3):
        assert node.send("Work", Amount=amount) == AckError.OK
    processed = node.telemetry("TcmdProcessed")
    assert processed == {"Processed": 0, "Waiting": 3, "Latest": 10, "Error": AckError.OK}
    Runner.run(node, until_us=WORK_US // 2)
    assert node.telemetry("TcmdProcessed") == {**processed, "Waiting": 2}
    Runner.run(node)
    assert node.now_us >= 3 * WORK_US
    assert node.telemetry("Done") == {"Sum": 6}
    assert node.telemetry("TcmdProcessed")["Processed"] == 1


def test_telecommand_without_an_action_changes_a_setting(node: Node) -> None:
    assert node.telemetry("Settings") == {"Level": 7}
    node.command("SetLevel", Level=200)
    assert node.telemetry("Settings") == {"Level": 200}


@pytest.mark.parametrize(
    ("payload", "error"),
    [
        ((10, 10), AckError.BAD_PARAMETER),
        ((10,), AckError.WRONG_LENGTH),
        ((77,), AckError.INVALID_ID),
    ],
)
def test_rejection_raises_a_flag(node: Node, payload: tuple[int, ...], error: AckError) -> None:
    assert node.frames(bytes(payload)) == [bytes([error])]
    assert [name for name, up in node.telemetry("ErrorFlags").items() if up] == ["TcmdRefused"]
    assert node.telemetry("TcmdProcessed")["Error"] == error


def test_full_queue_rejects_telecommands(node: Node) -> None:
    for _ in range(QUEUE_DEPTH):
        assert node.send("SetLevel") == AckError.OK
    assert node.send("SetLevel") == AckError.BUFFER_FULL
    assert node.telemetry("ErrorFlags")["TcmdBufferOverflow"]


def test_node_flags_are_raised_and_cleared(node: Node) -> None:
    node.command("Work", Amount=9)
    node.command("Work", Amount=1)
    assert node.telemetry("ErrorFlags")["Overdone"]
    node.command("ClearErrorFlags")
    assert not any(node.telemetry("ErrorFlags").values())


def test_reset_restores_defaults_but_keeps_the_runtime(node: Node) -> None:
    node.command("SetLevel", Level=1)
    node.now_us = 2_345_000
    node.command("Reset")
    assert node.resets == [TELECOMMAND]
    assert node.telemetry("Settings") == {"Level": 7}
    identification = node.telemetry("Identification")
    assert (identification["NodeType"], identification["InterfaceVersion"]) == (0x30, 3)
    assert (identification["RuntimeSeconds"], identification["RuntimeMilliseconds"]) == (2, 345)


def test_uart_and_i2c_carry_the_same_messages(node: Node) -> None:
    node.i2c_write(bytes([10, 4]))
    Runner.run(node)
    assert node.i2c_read(3, 140) == bytes([4, 0, 255])


DOCS = Path(__file__).parents[3] / "docs" / "sensors"
NEXT_US = 5_000  # from one request to the next: settings are applied, measurements are not over


def exchanges(page: str) -> list[tuple[str, str]]:
    blocks = re.findall(r"```wire\n(.*?)```", (DOCS / page).read_text("utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    sent = [line[3:] for line in lines if line.startswith("-> ")]
    received = [line[3:] for line in lines if line.startswith("<- ")]
    assert len(sent) == len(received) == len(lines) / 2 > 0
    return list(zip(sent, received, strict=True))


@pytest.mark.parametrize(
    ("page", "power_on", "pause_us"),
    [("protocols.md", CubeStar, None), ("protocols-cubesense.md", lambda _: CubeSense(), NEXT_US)],
)
def test_documented_protocol_examples_work(
    page: str,
    power_on: Callable[[StarCatalogue], CubeStar | CubeSense],
    pause_us: int | None,
    catalogue: StarCatalogue,
) -> None:
    unit = power_on(catalogue)
    for request, answer in exchanges(page):
        assert unit.wire(bytes.fromhex(request)).hex(" ") == answer, request
        unit.run(None if pause_us is None else unit.now_us + pause_us)
