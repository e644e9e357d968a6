"""What each fault does to a CubeSense, and what the firmware makes of it; see docs/faults.md."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.sky.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubesense_codes import (
    Camera,
    CaptureResult,
    DetectResult,
    Sram,
)
from cubestack.firmware_model.interface.cubesense_fpga import FULL_SIZE
from cubestack.firmware_model.interface.node_codes import AckError
from cubestack.host.errors import NoAnswerError
from cubestack.host.i2c_client import I2cClient

CLEAN_DEG = (-7.98, 12.02)
BYTE_S = 10 / CUBESENSE.baud


@pytest.fixture
def board(opened: Callable[..., Any], scene: EarthSunScene) -> Iterator[Any]:
    """A session whose nadir camera has measured once."""
    with opened(scene, seed=4) as session:
        first = session.cubesense.capture_and_detect(Camera.NADIR)
        assert (first.alpha_deg, first.beta_deg) == CLEAN_DEG
        yield session


def measure(board: Any, kind: str, **options: Any) -> Any:
    """A nadir measurement with a fault, which is cleared then."""
    options.setdefault("target", "nadir")
    board.board.faults.inject(kind, **options)
    found = board.cubesense.capture_and_detect(Camera.NADIR)
    board.board.faults.clear()
    assert board.board.faults.log[0].kind == kind
    return found


def picture(board: Any) -> np.ndarray:
    """What the nadir camera's memory holds; an address is row : column."""
    rows = board.board.engine.memories["nadir"].reshape(-1, 1024)
    return rows[: FULL_SIZE.rows, : FULL_SIZE.columns].copy()


def check_sound(board: Any) -> None:
    """The next measurement is as good as the first."""
    again = board.cubesense.capture_and_detect(Camera.NADIR)
    assert again.detected
    assert (again.alpha_deg, again.beta_deg) == pytest.approx(CLEAN_DEG, abs=0.02)


def test_a_late_acknowledge_only_delays(board: Any) -> None:
    found = measure(board, "ack-late", target="NADACK", delay_us=10_000)
    assert found.detected
    check_sound(board)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("ack-lost", {"target": "NADACK"}),
        ("ack-late", {"target": "NADACK", "delay_us": 80_000}),
        ("line-missing", {}),
    ],
)
def test_without_acknowledge_the_camera_times_out(
    board: Any, kind: str, options: dict[str, Any]
) -> None:
    found = measure(board, kind, **options)
    assert found.capture is CaptureResult.CAMERA_TIMEOUT
    assert found.detect is DetectResult.NONE_SCHEDULED
    check_sound(board)


def test_an_acknowledge_that_is_always_there_measures_the_old_picture(board: Any) -> None:
    board.board.scene = EarthSunScene.facing(nadir_deg=(5, 5))
    found = measure(board, "ack-stuck", target="NADACK")
    assert found.detected
    assert (found.alpha_deg, found.beta_deg) == pytest.approx(CLEAN_DEG, abs=0.02)
    again = board.cubesense.capture_and_detect(Camera.NADIR)
    assert (again.alpha_deg, again.beta_deg) == pytest.approx((5, 5), abs=0.1)


@pytest.mark.parametrize("pin", ["NADEN", "RNW", "EDGE"])
def test_a_glitch_while_storing_costs_no_more_than_frames(board: Any, pin: str) -> None:
    at_s = board.board.kernel.now / 1e12 + 0.03
    found = measure(board, "control-glitch", target=pin, at_s=at_s)
    assert found.capture in (CaptureResult.STORED_OWN_SRAM, CaptureResult.CAMERA_TIMEOUT)
    check_sound(board)


@pytest.mark.parametrize(("kind", "moved"), [("clock-lost", 1), ("clock-extra", -1)])
def test_a_wrong_clock_moves_the_rest_of_one_line(board: Any, kind: str, moved: int) -> None:
    board.board.scene = EarthSunScene.facing(nadir_deg=CLEAN_DEG, noise=False, hot_pixels=0)
    board.cubesense.capture_and_detect(Camera.NADIR)
    clean = picture(board)
    found = measure(board, kind, row=100, column=20)
    assert found.detected
    line, before = picture(board)[100], clean[100]
    first, second = (line, before) if moved > 0 else (before, line)
    np.testing.assert_array_equal(first[21:-1], second[22:])
    np.testing.assert_array_equal(np.delete(picture(board), 100, 0), np.delete(clean, 100, 0))
    assert not board.board.engine.violations


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("pixel-hot", {"x": 10, "y": 10}),
        ("pixel-dead", {}),
        ("column-defect", {"x": 300}),
        ("memory-upsets", {"rate": 1e-4}),
        ("memory-stuck", {}),
        ("memory-flip", {}),
    ],
)
def test_what_the_fit_bears(board: Any, kind: str, options: dict[str, Any]) -> None:
    found = measure(board, kind, **options)
    assert found.detected
    assert (found.alpha_deg, found.beta_deg) == pytest.approx(CLEAN_DEG, abs=0.05)


def test_blooming_spoils_the_limb(board: Any) -> None:
    found = measure(board, "blooming", threshold=150)
    assert (found.capture, found.detect) == (CaptureResult.STORED_OWN_SRAM, DetectResult.BAD_FIT)
    check_sound(board)


def test_a_bright_hot_pixel_pair_is_the_suns(board: Any) -> None:
    """The FPGA looks for a run of bright pixels: one alone is passed over."""
    board.board.faults.inject("pixel-hot", target="sun", x=10, y=10)
    found = board.cubesense.capture_and_detect(Camera.SUN)
    assert (found.alpha_deg, found.beta_deg) == pytest.approx((20, 10), abs=0.1)


def test_a_dead_camera_times_out_and_comes_back_with_other_registers(board: Any) -> None:
    found = measure(board, "camera-dead")
    assert found.capture is CaptureResult.CAMERA_TIMEOUT
    # The firmware believes the registers to be as it left them.
    again = board.cubesense.capture_and_detect(Camera.NADIR)
    assert abs(again.beta_deg - CLEAN_DEG[1]) > 0.1
    sun = board.cubesense.capture_and_detect(Camera.SUN)
    assert sun.detected


def test_a_latched_memory_is_cut_until_a_telecommand(board: Any) -> None:
    found = measure(board, "latch-up", target="SRAM2")
    assert found.capture is CaptureResult.SRAM_OVER_CURRENT
    other = board.cubesense.capture_and_detect(Camera.NADIR, Sram.SRAM1)
    assert other.capture is CaptureResult.STORED_OTHER_SRAM
    board.cubesense.clear_over_current()
    check_sound(board)


def test_register_upsets_cost_a_measurement(board: Any) -> None:
    measure(board, "register-upsets", target="fpga", rate=10)
    assert board.board.faults.events > 100
    check_sound(board)


def test_the_bench_line_has_faults_of_its_own(board: Any) -> None:
    board.board.faults.inject("uart-drop", target="bench")
    with pytest.raises(NoAnswerError):
        board.bench.take(Camera.SUN)
    assert board.cubesense.serial_number()
    board.board.faults.clear()
    board.bench.take(Camera.SUN)


# --- serial line and I2C --------------------------------------------------------------------------


def line_flags(board: Any) -> set[str]:
    """Flags of telemetry CommunicationStatus."""
    values = board.cubesense.client.telemetry("CommunicationStatus")
    return {name for name, value in values.items() if value and not name.endswith("Count")}


def now_s(board: Any) -> float:
    return float(board.board.kernel.now / 1e12)


@pytest.mark.parametrize("kind", ["uart-drop", "uart-corrupt"])
def test_a_spoilt_byte_to_the_device_is_asked_for_again(board: Any, kind: str) -> None:
    board.board.faults.inject(kind, direction="to-device", for_s=BYTE_S / 2)
    assert board.cubesense.serial_number()
    assert board.board.faults.events == 1
    assert line_flags(board) == {"UartProtocolError"}


def test_a_message_held_up_in_the_middle_is_given_up(board: Any) -> None:
    at_s = now_s(board) + 2.5 * BYTE_S
    board.board.faults.inject(
        "uart-delay", direction="to-device", delay_ms=60, at_s=at_s, for_s=0.05
    )
    assert board.cubesense.serial_number()
    assert line_flags(board) == {"UartMsgIncomplete", "UartProtocolError"}


def test_a_byte_without_acknowledge_cuts_a_telecommand_short(board: Any) -> None:
    client = I2cClient(board.board.i2c(), CUBESENSE, wait=board.board.i2c().wait)
    at_s = now_s(board) + 0.00015  # the address ends after 0.1 ms, a byte takes 0.09 ms
    board.board.faults.inject("i2c-nack", on="byte", at_s=at_s, for_s=0.0003)
    with pytest.raises(NoAnswerError):
        client.command("SetNadirSearch", Search=0)
    assert board.board.faults.events == 1
    assert client.telemetry("TcmdProcessed")["Error"] in (0, AckError.WRONG_LENGTH)
    assert client.telemetry("Identification")["InterfaceVersion"] == CUBESENSE.version


@pytest.mark.parametrize("line", ["SDA", "SCL"])
def test_a_stuck_line_blocks_the_bus_until_it_is_free(board: Any, line: str) -> None:
    bus = board.board.i2c()
    board.board.faults.inject("i2c-stuck", line=line, for_s=1.3)
    client = I2cClient(bus, CUBESENSE, wait=bus.wait)
    began_s = now_s(board)
    assert client.telemetry("Identification")["InterfaceVersion"] == CUBESENSE.version
    assert now_s(board) - began_s > 1.3  # the first attempt had failed after 1 s
    assert line_flags(board) == set()


def test_a_stretched_clock_only_takes_time(board: Any) -> None:
    bus = board.board.i2c()
    client = I2cClient(bus, CUBESENSE, wait=bus.wait)
    board.board.faults.inject("i2c-stretch", stretch_us=900)
    assert client.telemetry("Identification")["InterfaceVersion"] == CUBESENSE.version
    assert board.board.faults.events == 1 + CUBESENSE.telemetry("Identification").length
