"""How long a message on a camera's control bus takes, its bits counted by hand."""

import pytest

from cubestack.emulator.boards.peripherals import I2cCameraBus
from cubestack.emulator.camera.mt9m001.sensor import Mt9m001
from cubestack.emulator.scene.sky import SkyScene
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
