"""CubeSense's board: pins, supplies, and what happens to pictures and memories.

A tiny program stands in for the firmware where only wires matter.
"""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import BOOT_US, CubeSenseBoard
from cubestack.emulator.boards.cubesense.processor import CHANNELS, GpioPins
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS, Kernel
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.interface.cubesense import pins
from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.firmware_model.interface.cubesense.pins import MA_PER_COUNT, Monitor

FRAME_MS = 34
DETECT = bytes.fromhex("1f7f1401011fff")  #: Capture and detect: nadir, SRAM2

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture
def board() -> Iterator[CubeSenseBoard]:
    """Which has been up for half a second."""
    made = CubeSenseBoard(EarthSunView(EarthSunScene(), FisheyeCondition(noise=False)), seed=4)
    let_pass(made, 500)
    yield made
    made.close()


def let_pass(board: CubeSenseBoard, ms: float) -> None:
    board.kernel.advance_to(board.kernel.now + int(ms * PS_PER_MS))


def test_board_starts_in_reset_with_all_supplies_off() -> None:
    board = CubeSenseBoard(EarthSunScene())
    assert not any(board.power.is_on(channel) for channel in CHANNELS.values())
    for ms in (0, BOOT_US / 1000 - 0.01):
        let_pass(board, ms)
        assert board.power.current_ma() * 5.0 == pytest.approx(41.9, rel=0.06)
    board.close()


def test_firmware_switches_all_channels_on_at_the_published_power(board: CubeSenseBoard) -> None:
    assert all(board.power.is_on(channel) for channel in CHANNELS.values())
    assert board.power.current_ma() * 5.0 == pytest.approx(359.5, rel=0.06)


def test_firmware_has_set_the_camera_exposures_over_their_control_lines(
    board: CubeSenseBoard,
) -> None:
    shutters = [board.cameras[camera].frame_from(board.kernel.now) for camera in Camera]
    assert [shutter.exposure_lines for shutter in shutters] == [2, 8]


def test_current_monitors_measure_the_drawn_currents(board: CubeSenseBoard) -> None:
    shown = {one: board.hardware.adc_counts(one) * MA_PER_COUNT for one in Monitor}
    whole_ma = shown[Monitor.SUPPLY_5V]
    assert shown[Monitor.SRAM1] == pytest.approx(4.6, abs=MA_PER_COUNT)
    assert whole_ma == pytest.approx(board.power.current_ma(), abs=MA_PER_COUNT)
    cameras_ma = whole_ma - shown[Monitor.SUPPLY_3V3]
    assert cameras_ma == pytest.approx(2 * 25.15, abs=2 * MA_PER_COUNT)
    board.power.latch_up("SRAM2", 5000.0)
    assert board.hardware.adc_counts(Monitor.SRAM2) == 1023  # no more than full scale


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("sram", Sram)
def test_storing_an_image_draws_memory_and_fpga_current(
    board: CubeSenseBoard, camera: Camera, sram: Sram
) -> None:
    """Storing takes it in one memory; FPGAs take it on their own, or both of them linked."""
    idle_ma = board.power.current_ma()
    board.serial().write(bytes([0x1F, 0x7F, 20, camera, sram, 0x1F, 0xFF]))
    let_pass(board, 10)
    taken = [board.power.current_ma(half.name) for half in Sram]
    assert taken == [7.6 if half is sram else 4.6 for half in Sram]
    fpgas = 1 if sram == camera else 2
    assert board.power.current_ma() - idle_ma == pytest.approx(3.0 + 4.3 * fpgas)
    let_pass(board, 500)
    assert board.power.current_ma() == pytest.approx(idle_ma)


def test_memory_loses_content_without_supply(board: CubeSenseBoard) -> None:
    before = {half: memory.copy() for half, memory in board.engine.memories.items()}
    board.power.switch("SRAM1", False)
    assert np.mean(board.engine.memories["sun"] != before["sun"]) > 0.9
    np.testing.assert_array_equal(board.engine.memories["nadir"], before["nadir"])


def test_memories_hold_seeded_noise_after_power_up() -> None:
    contents = []
    for seed in (1, 1, 2):
        board = CubeSenseBoard(EarthSunScene(), seed=seed)
        contents.append(board.engine.memories["sun"].copy())
        board.close()
    np.testing.assert_array_equal(contents[0], contents[1])
    assert np.mean(contents[0] != contents[2]) > 0.9


def test_dead_camera_has_no_clock_and_no_answers(board: CubeSenseBoard) -> None:
    board.faults.inject("camera-dead", target="sun")
    camera = board.cameras[Camera.SUN]
    assert camera.segment_at(board.kernel.now) is None
    board.power.switch("sun_camera", False)
    board.power.switch("sun_camera", True)
    assert not camera.running


@pytest.mark.parametrize("camera", Camera)
def test_frames_begin_when_the_camera_starts(board: CubeSenseBoard, camera: Camera) -> None:
    """Its first row comes after 45 blank lines of 858 clocks, whatever the FPGAs did before."""
    supply = f"{camera.name.lower()}_camera"
    board.power.switch(supply, False)
    let_pass(board, 7.3)
    board.power.switch(supply, True)
    first = board.cameras[camera].frame_from(board.kernel.now)
    blank_ms = 45 * 858 / 13.5e6 * 1e3
    assert (first.readout_ps - board.kernel.now) / PS_PER_MS == pytest.approx(blank_ms)


def test_failed_memory_draws_over_current_at_each_power_up(board: CubeSenseBoard) -> None:
    board.faults.inject("latch-up", target="SRAM1", lasting=True)
    assert board.power.current_ma("SRAM1") > 100
    let_pass(board, 100)
    assert not board.power.is_on("SRAM1")  # the firmware has cut it off
    board.power.switch("SRAM1", True)
    assert board.power.current_ma("SRAM1") > 100


def test_truth_describes_the_stored_frame(board: CubeSenseBoard) -> None:
    assert board.truth(Camera.NADIR) is None
    board.scene = EarthSunScene(rate_deg_s=(0, 10.0, 0))
    start_ms = board.kernel.now / PS_PER_MS
    board.serial().write(DETECT)
    let_pass(board, 400)
    truth = board.truth(Camera.NADIR)
    assert start_ms < abs(truth.alpha_deg) / 10.0 * 1000 < start_ms + 10 + 2 * FRAME_MS
    assert board.truth(Camera.SUN) is None


def test_node_and_bench_ports_are_separate(board: CubeSenseBoard) -> None:
    node, bench = board.serial(), board.serial("bench_uart")
    board.hardware.uart_send(b"bench", Port.BENCH)
    board.hardware.uart_send(b"node")
    assert bench.read(10, 0.1)[:1] == b"b"
    let_pass(board, 2)
    assert (node.read(10, 0.1), bench.read(10, 0.0)) == (b"node", b"ench")


def test_each_protocol_has_its_own_address(board: CubeSenseBoard) -> None:
    from smbus2 import i2c_msg

    bus = board.i2c()
    identification, threshold = i2c_msg.read(0x1B, 8), i2c_msg.read(0x1C, 1)
    bus.i2c_rdwr(i2c_msg.write(0x1B, [0x80]), identification)
    bus.i2c_rdwr(i2c_msg.write(0x1C, [0x00]), threshold)
    assert (list(identification)[1], list(threshold)) == (2, [225])  # interface version first


def test_board_is_busy_only_while_working(board: CubeSenseBoard) -> None:
    assert not board.busy()
    board.serial().write(DETECT)
    for ms, busy in ((0, True), (50, True), (500, False)):
        let_pass(board, ms)
        assert board.busy() is busy


def test_reset_of_the_processor_releases_every_pin(board: CubeSenseBoard) -> None:
    board.serial().write(bytes.fromhex("1f7f00031fff"))
    while not board.processor.resets:
        let_pass(board, 0.1)
    assert not any(board.power.is_on(channel) for channel in CHANNELS.values())
    assert [board.engine.get_pin(pin) for pin in ("SUNEN", "NADEN")] == [1, 1]
    let_pass(board, 500)
    assert board.processor.resets == 1
    assert all(board.power.is_on(channel) for channel in CHANNELS.values())
    assert board.hardware.uptime_us() == pytest.approx(500_000, abs=5_000)


def test_lines_are_open_drain(board: CubeSenseBoard) -> None:
    lines = GpioPins(board.kernel, board.cameras, board.power)
    scl, sda = pins.CAMERA_SCL[Camera.SUN], pins.CAMERA_SDA[Camera.SUN]
    assert all(pin in lines for pin in (scl, sda, *pins.SRAM_POWER.values()))
    assert "SUNEN" not in lines
    assert lines.get_pin(sda) == 1
    assert {lines.get_pin(pin) for pin in pins.CAMERA_SDA.values()} == {1}
    lines.set_pin(sda, 0)
    assert (lines.get_pin(sda), lines.get_pin(scl)) == (0, 1)
    lines.release()
    assert (lines.get_pin(sda), lines.get_pin(scl)) == (1, 1)


def test_reset_releases_control_lines_and_switches_supplies_off() -> None:
    lines: dict[tuple[Camera, str], int] = {}
    switched: dict[str, bool] = {}

    def camera(which: Camera) -> Any:
        return SimpleNamespace(
            on_pin=lambda line, level, _now_ps: lines.update({(which, line): level})
        )

    power: Any = SimpleNamespace(switch=switched.__setitem__)
    driven = GpioPins(Kernel(), {which: camera(which) for which in Camera}, power)
    high = {(which, line): 1 for which in Camera for line in ("SCL", "SDA")}
    off = dict.fromkeys(CHANNELS.values(), False)
    assert (lines, switched) == (high, off)
    for pin in (*pins.CAMERA_SCL.values(), *pins.CAMERA_SDA.values()):
        driven.set_pin(pin, 0)
    for pin in CHANNELS:
        driven.set_pin(pin, 1)
    assert set(lines.values()) == {0}
    assert set(switched.values()) == {True}
    driven.release()
    assert (lines, switched) == (high, off)
