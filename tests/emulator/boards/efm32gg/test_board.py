"""The example's application on the bare part: its pins, its serial line and its faults."""

from collections.abc import Iterator

import pytest

from cubestack.emulator.boards.efm32gg.board import Efm32ggBoard
from cubestack.emulator.iss.image import Image
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S
from tests.emulator.boards.efm32gg.programs import needs_both_compilers
from tests.emulator.iss.efm32gg.bench import address_of, mask_of

pytestmark = needs_both_compilers

BUTTON, LED = "PB9", "PE2"


@pytest.fixture
def board(app: Image) -> Iterator[Efm32ggBoard]:
    board = Efm32ggBoard(app, seed=2)
    yield board
    board.close()


def wait_ms(board: Efm32ggBoard, ms: int) -> None:
    board.kernel.advance_to(board.kernel.now + ms * PS_PER_MS)


def test_button_switches_the_led_and_the_uart_reports_it(board: Efm32ggBoard) -> None:
    port = board.serial()
    wait_ms(board, 5)
    assert port.read(64, 0) == b"ready\n"
    assert board.pins.output(LED) == 0
    pressed_s = board.kernel.now / PS_PER_S
    board.pins[BUTTON] = 0
    assert 0.004 < board.pins.wait_for(LED, 1) - pressed_s < 0.0061  # stable for five ticks
    wait_ms(board, 5)
    del board.pins[BUTTON]  # its pull-up
    wait_ms(board, 10)
    board.pins[BUTTON] = 0
    board.pins.wait_for(LED, 0)
    wait_ms(board, 5)
    assert port.read(64, 0) == b"on\noff\n"


def test_wait_for_a_level_times_out(board: Efm32ggBoard) -> None:
    with pytest.raises(TimeoutError, match=r"^PE2 is not 1 within 0\.25 s$"):
        board.pins.wait_for(LED, 1, 0.25)
    assert board.kernel.now == 0.25 * PS_PER_S


def test_firmware_drives_harder_than_the_outside(board: Efm32ggBoard) -> None:
    wait_ms(board, 5)
    board.pins[LED] = 1
    assert (board.pins[LED], board.pins.driven(LED)) == (0, 0)
    board.pins["PA3"] = 1  # disabled, so the part drives nothing
    assert (board.pins["PA3"], board.pins.driven("PA3"), board.pins.output("PA3")) == (1, 1, None)
    del board.pins["PA3"]
    assert (board.pins["PA3"], board.pins.driven("PA3")) == (0, "z")


def test_dac_voltage_is_readable_at_its_pin(board: Efm32ggBoard) -> None:
    wait_ms(board, 5)
    write, enables = board.machine.write, address_of("CMU.HFPERCLKEN0")
    write(enables, (board.machine.read(enables) or 0) | mask_of("CMU.HFPERCLKEN0.DAC0"))
    for name, value in (("CTRL", 1 << 4 | 2 << 8), ("CH0CTRL", 1), ("CH0DATA", 2048)):
        write(address_of(f"DAC0.{name}"), value)
    wait_ms(board, 1)
    assert board.pins.millivolts("PB11") == pytest.approx(3300 * 2048 / 4095)
    assert board.pins.millivolts("PB12") is None


def test_rejects_unknown_pins_and_levels(board: Efm32ggBoard) -> None:
    for pin in ("PA16", "PG0", "pa1", "LED"):
        with pytest.raises(ValueError, match=f"^'{pin}' is no pin, as PA0 or PE10 are$"):
            board.pins[pin]
    with pytest.raises(ValueError, match=r"^the level of PA0 must be 0 or 1, not 2$"):
        board.pins["PA0"] = 2


def test_resets_can_be_forced(board: Efm32ggBoard) -> None:
    port = board.serial()
    wait_ms(board, 5)
    for number, cause in enumerate(("brown-out", "reset-pin", "lock-up"), 1):
        board.faults.inject_words(["processor-reset", cause])
        wait_ms(board, 5)
        assert board.processor.resets == number
    assert port.read(64, 0) == b"ready\n" * 4
    assert set(board.faults.kinds()) >= {"uart-corrupt", "processor-reset", "memory-flip"}


def test_same_seed_gives_same_ram(app: Image) -> None:
    rams = []
    for seed in (2, 2, 3):
        board = Efm32ggBoard(app, seed=seed)
        rams.append(board.machine.ram.tobytes())
        board.close()
    assert rams[0] == rams[1] != rams[2]


def test_has_no_scene(board: Efm32ggBoard) -> None:
    board.scene = None
    with pytest.raises(TypeError, match=r"^a bare part has no camera; leave the scene 'x' out$"):
        board.scene = "x"
