"""What programs have of their boards, and how long a message on a camera's bus takes, by hand."""

from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.boards.peripherals import I2cCameraBus, NodePeripherals
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.camera.mt9m001.sensor import Mt9m001
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS, Kernel
from cubestack.firmware_model.mcu.requests import CameraTransfer


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
def test_a_message_takes_its_bits(request_: CameraTransfer, bits: int, hz: int) -> None:
    camera = Mt9m001(SkyScene.pointing(80.0, 0.0))
    bus = I2cCameraBus(camera, 0x5D, hz)
    assert bus.transfer_ps(request_) == bits * 10**12 // hz


def test_a_camera_answers_to_its_own_address_only() -> None:
    camera = Mt9m001(SkyScene.pointing(80.0, 0.0))
    version = CameraTransfer(b"\x00", 2)
    assert I2cCameraBus(camera, 0x5D, 100_000).transfer(version, 0) == b"\x84\x31"
    assert I2cCameraBus(camera, 0x5D, 100_000).transfer(CameraTransfer(b"\x00"), 0) == b""
    assert I2cCameraBus(camera, 0x5C, 100_000).transfer(version, 0) is None


def test_a_program_s_line_clock_and_sleep() -> None:
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
