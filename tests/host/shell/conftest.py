from typing import Any
from unittest.mock import Mock

import pytest

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.emulation.controls import EmulatedControls
from cubestack.host.shell.language import Shell
from cubestack.host.shell.names import CommandResult
from cubestack.host.targets import Target

from ..conftest import LetterLine, Slave, UartLink

#: What controls of an emulated device have and answer.
CONTROLS = {
    "faults": ("latch-up SRAM1", "latch-up SRAM2", "camera sun"),
    "fault_parameters": {"latch-up": ("extra_ma", "at_s"), "camera": ("for_s",)},
    "channels": ("SRAM1", "SRAM2"),
    "fault_log.return_value": ["0.1 s latch-up SRAM1"],
    "currents.return_value": {"total": 71.94, "SRAM1": 0.25},
    "time_s.return_value": 1.5,
    "peek.return_value": {"TIMER0.CNT": (7, "0x7"), "x": (None, "not there")},
}


class Known:
    """A shell on a CubeSense with all ports and controls."""

    def __init__(self, sense: Any) -> None:
        registers = RegisterClient(Slave(), INTERFACE.registers, wait=lambda _s: None)
        self.line = UartLink(sense)
        self.letters = LetterLine(q=b"Y", a=b"12345678", b=b"123456789", s=bytes(100))
        self.controls = Mock(EmulatedControls, **CONTROLS)
        node = NodeClient(self.line, INTERFACE)
        ports = (self.line, registers, self.letters, self.controls)
        self.target = Target("fake", INTERFACE, node, *ports)
        self.shell = Shell(self.target)

    def run(self, line: str) -> CommandResult:
        result = self.shell.execute(line)
        assert result is not None
        return result


@pytest.fixture
def known(sense: Any) -> Known:
    return Known(sense)


@pytest.fixture
def sense_shell(known: Known) -> Shell:
    return known.shell
