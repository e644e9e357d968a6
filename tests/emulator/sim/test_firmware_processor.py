import pytest

from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard
from cubestack.emulator.iss.image import load_image
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from cubestack.firmware_model.reference.image import reference_image

PHASE_TIMES = bytes.fromhex("1f7fc91fff")


def test_byte_is_received_when_it_ends_though_an_answer_wakes_the_processor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    board = CubeStarFirmwareBoard(SkyScene.pointing(84, -1), load_image(reference_image()))
    machine, early = board.machine, list[int]()
    receive = machine.uart_receive

    def received(unit: int, data: int, flags: int = 0) -> None:
        early.append(board.kernel.now - machine.now_ps)
        receive(unit, data, flags)

    monkeypatch.setattr(machine, "uart_receive", received)
    board.kernel.advance_to(50 * PS_PER_MS)
    board.uart.host_writes(4 * PHASE_TIMES)  # each answer is sent during the next request
    board.kernel.advance_to(70 * PS_PER_MS)
    board.close()
    assert len(early) == 4 * len(PHASE_TIMES)
    assert max(early) <= 0
