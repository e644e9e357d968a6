from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard
from cubestack.emulator.iss.image import Image, load_image
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, PS_PER_US
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import processor_pins as wired
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.interface.efm32gg.pins import pin_number
from tests.emulator.boards.cubestar.builds import build, needs_both_compilers

pytestmark = needs_both_compilers

RESULTS = 0x1_0000  #: Where the programs leave their results, in RAM

SKY = SkyScene(np.array([0.0, 0.0, 0.0, 1.0]), mag_limit=3.8)


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Image]:
    folder = tmp_path_factory.mktemp("firmware")
    return {name: load_image(build(name, folder)) for name in ("toggle", "picture")}


def powered(image: Image, late: int = 0, **options: Any) -> CubeStarFirmwareBoard:
    board = CubeStarFirmwareBoard(SKY, image, seed=3, **options)
    board.machine.ram[RESULTS : RESULTS + 64].view(np.uint32)[:] = [0] * 8 + [late] * 8
    assert board.camera.i2c_write(REGISTERS.i2c_address, b"\x81\x00\x21", 0)
    return board


def results(board: CubeStarFirmwareBoard) -> list[int]:
    words = board.machine.ram[RESULTS : RESULTS + 0x1000].view(np.uint32).tolist()
    return words[: words.index(0x600D)] if 0x600D in words else []


def toggled(image: Image, **options: Any) -> tuple[list[int], Any, bytes, int]:
    """Everything that the program saw, what was broken, what is in the SRAM."""
    board = powered(image, **options)
    board.kernel.advance_to(3 * PS_PER_MS)
    seen = results(board)
    assert len(seen) == 3 * 44
    memory, board_time = board.engine.sram.tobytes(), board.machine.cycles
    violations = [str(one) for one in board.engine.violations]
    board.close()
    return seen, violations, memory, board_time


@pytest.mark.slow
def test_fpga_behaves_the_same_by_driver_callbacks_and_simulation(images: dict[str, Image]) -> None:
    compiled = toggled(images["toggle"], engine="compiled")
    assert len(set(compiled[0])) > 20
    assert toggled(images["toggle"], engine="compiled", callbacks=True) == compiled
    assert toggled(images["toggle"], engine="python") == compiled


def test_firmware_reads_the_image_through_the_fpga_into_external_memory(
    images: dict[str, Image],
) -> None:
    board = powered(images["picture"], engine="compiled")
    while not results(board) and board.kernel.now < PS_PER_S:
        board.kernel.advance_to(board.kernel.now + 20 * PS_PER_MS)
    picture = board.external_ram[: 512 * 1024]
    assert results(board)
    assert np.array_equal(picture, board.engine.sram[: 512 * 1024])
    assert len(np.unique(picture)) > 10
    assert board.truth() is not None
    assert not board.engine.violation_counts
    board.close()


def test_acknowledge_interrupts_at_a_microsecond_whenever_that_is_enabled(
    images: dict[str, Image],
) -> None:
    """Without an enabled interrupt nobody looks at the pin between the program's own reads."""
    woken = set()
    for late in (0, 48_000, 960_007):
        board = powered(images["picture"], late, engine="compiled")
        while not (cycles := board.machine.ram[RESULTS : RESULTS + 4].view(np.uint32)[0]):
            board.kernel.advance_to(board.kernel.now + PS_PER_MS)
        woken.add(int(cycles))
        board.close()
    assert len(woken) == 1
    rose = woken.pop()
    assert rose > 960_007
    board = powered(images["picture"], rose + 480, engine="compiled")
    board.kernel.idle_until = 2 * rose * PS_PER_S // 48_000_000  # one run of the machine
    board.kernel.advance_to(board.kernel.idle_until)
    assert board.engine.get_pin("ACK")
    assert not board.machine.ram[RESULTS]  # the change was before
    board.close()


def test_levels_of_pins_are_those_of_the_fpga(images: dict[str, Image]) -> None:
    board = powered(images["picture"], late=1 << 31, engine="compiled")
    seen = 0
    while not seen:  # the program never reads it
        board.kernel.advance_to(board.kernel.now + 100 * PS_PER_US)
        seen = board.machine.pin_level(*divmod(pin_number(wired.FPGA["ACK"]), 16))
        assert seen == board.engine.get_pin("ACK")
    board.close()


def test_rejects_other_layouts_in_one_line(images: dict[str, Image]) -> None:
    with pytest.raises(ValueError, match=r"own firmware runs on memory layout 1, not two-boards"):
        powered(images["toggle"], layout=Layout.TWO_BOARDS)


def test_pin_faults_are_seen_and_leave_no_residue(images: dict[str, Image]) -> None:
    board = powered(images["toggle"], engine="compiled")
    board.faults.inject("ack-stuck", level=1, for_s=0.001)
    board.kernel.advance_to(PS_PER_MS // 2)
    assert board.processor.fpga is not board.engine
    assert board.processor.fpga.driver is None
    board.kernel.advance_to(3 * PS_PER_MS)
    assert [results(board)[44 * number] for number in range(3)] == [0, 0, 0]
    assert board.processor.fpga.driver is board.engine.driver
    board.close()


def test_flipped_code_bits_are_executed(images: dict[str, Image]) -> None:
    board = powered(images["toggle"], engine="compiled")
    board.kernel.advance_to(PS_PER_MS * 4 // 10)  # it has executed them before
    address = int.from_bytes(board.machine.flash[4:8].tobytes(), "little") & ~1
    for bit in range(32):  # of the first instructions after a reset
        place = {"address": address + bit // 8, "bit": bit % 8}
        board.faults.inject("memory-flip", target="flash", **place)
    board.faults.inject("processor-reset", target="reset-pin")
    board.kernel.advance_to(5 * PS_PER_MS)
    assert not results(board)
    board.close()


@pytest.mark.parametrize(("level", "on"), [(0, False), (1, True), (-1, True)])
def test_floating_switch_pin_is_pulled_up(images: dict[str, Image], level: int, on: bool) -> None:
    """A pin that floats, -1, has the supply on, as before the program began."""
    board = powered(images["toggle"])
    for channel, pin in wired.SWITCHES.items():
        board.power.switch(channel, not on)
        board._pin(Outgoing(OutgoingKind.PIN, pin_number(pin), level, 0, board.kernel.now))
        assert board.power.is_on(channel) is on
    reset = pin_number(wired.CAMERA_RESET)
    board._pin(Outgoing(OutgoingKind.PIN, reset, level, 0, board.kernel.now))
    assert board.camera.running is (on and board.power.is_on("imager"))
    board.close()


def test_camera_reset_truncates_the_image(images: dict[str, Image]) -> None:
    """What was sent before is stored; the sky is dark, the rest of the memory was random."""
    board = powered(images["toggle"], engine="compiled")
    frame = board.camera.frame_from(0)
    board.engine.set_pin("ENABLE", 1)
    board._pin(Outgoing(OutgoingKind.PIN, pin_number(wired.CAMERA_RESET), 0, 0, 20 * PS_PER_MS))
    board.engine.run(30 * PS_PER_MS)
    dark_rows = board.engine.sram[: 512 * 1024].reshape(512, 1024).mean(axis=1) < 20
    board.close()
    sent = int((20 * PS_PER_MS - frame.readout_ps) / frame.line_ps)
    # The first line is joined in its middle, so it is not there.
    assert dark_rows.tolist() == [row < sent - 1 for row in range(512)]
