import pytest

from cubestack.firmware_model.aramis.program import AramisProgram
from cubestack.firmware_model.interface.aramis import INTERFACE
from cubestack.firmware_model.node.commands import QueuedCommand

from .harness import Harness


@pytest.mark.parametrize("name", ["WriteCameraRegister", "SelectCameraRegister"])
def test_a_register_of_a_camera_that_does_not_answer(name: str) -> None:
    unit = Harness()
    program = AramisProgram(unit, unit.meter)
    command = QueuedCommand(INTERFACE.telecommand(name), {"Address": 9, "Value": 5})
    unit.perform(program.commands.execute(command))
    assert not program.state.flags
    unit.registers = None
    unit.perform(program.commands.execute(command))
    assert program.state.flags == {"CameraSilent"}
