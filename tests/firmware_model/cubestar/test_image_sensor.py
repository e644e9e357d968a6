"""The camera's registers, as the firmware writes and reads them."""

import pytest

from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import TaskStatus

from .bench import CAMERA_BYTE_US, Bench


def written(bench: Bench) -> list[str]:
    """Names of the registers of all messages."""
    names = []
    for data in bench.camera_writes:
        register = REGISTERS.at(int.from_bytes(data[:2], "big"))
        assert register is not None
        names.append(register.name)
    return names


def test_the_set_up_for_stars(bench: Bench) -> None:
    bench.command("CaptureImage")
    assert written(bench) == [
        "MODE_SELECT",
        "HARDWARE_FEATURES",
        "LINEARITY",
        "FRAMES_PER_SECOND",
        "FIRMWARE_FEATURES",
        "EXPOSURE_RULE",
        "EXPOSURE",
        "SYNC",
        "MODE_SELECT",
        "MODE_SELECT",
    ]
    features = REGISTERS["HARDWARE_FEATURES"]
    value = bench.camera_value("HARDWARE_FEATURES")
    on = {field.name for field in features.fields if field.of(value)}
    assert on == {field.name for field in features.fields} - {"SHARPENING"}
    firmware = REGISTERS["FIRMWARE_FEATURES"]
    value = bench.camera_value("FIRMWARE_FEATURES")
    assert {field.name for field in firmware.fields if field.of(value)} == {"AUTOVIEW"}
    assert bench.camera_value("LINEARITY") == 0
    assert bench.camera_value("FRAMES_PER_SECOND") == 7
    assert bench.camera_value("EXPOSURE_RULE") == 2
    assert bench.camera_value("SYNC") == 3
    mode = REGISTERS["MODE_SELECT"]
    modes = [data[2] for data in bench.camera_writes if data[:2] == b"\x81\x00"]
    assert [mode.field("ENABLE").of(value) for value in modes] == [0, 1, 0]
    assert [mode.field("OUTPUT_DEPTH").of(value) for value in modes] == [1, 1, 1]


def test_it_is_done_once_and_again_after_a_change(bench: Bench) -> None:
    bench.command("CaptureImage")
    bench.camera_writes.clear()
    bench.command("CaptureImage")
    assert written(bench) == ["MODE_SELECT", "MODE_SELECT"]
    bench.command("Exposure", exposure=1234)
    bench.command("CaptureImage")
    assert bench.camera_value("EXPOSURE") == 1234
    assert bench.camera_value("EXPOSURE_RULE") == 0
    bench.camera_writes.clear()
    bench.command("MCUReset")
    bench.command("CaptureImage")
    assert written(bench) == ["MODE_SELECT", "MODE_SELECT"]  # the camera kept its registers


@pytest.mark.parametrize("step", range(8))
def test_every_step_of_the_set_up_can_fail(bench: Bench, step: int) -> None:
    messages = []

    def refuse(data: bytes) -> bool:
        messages.append(data)
        return len(messages) == step + 1

    bench.camera_refuses = refuse
    bench.command("CaptureImage")
    assert bench.flags() == {"ISSetupError"}
    assert len(messages) == step + 1
    bench.command("CaptureImage")
    assert len(written(bench)) == step + 8 + 2  # all of it again


@pytest.mark.parametrize("step", range(8))
def test_every_step_of_a_change_can_fail(bench: Bench, step: int) -> None:
    bench.command("CaptureImage")
    bench.command("SetFrameRate", FrameRate=9)
    messages = []

    def refuse(data: bytes) -> bool:
        messages.append(data)
        return len(messages) == step + 1

    bench.camera_refuses = refuse
    bench.command("CaptureImage")
    assert bench.flags() == {"ConfigChangeError"}
    # Half of it may be written: the old setting has to be written too when it comes back.
    bench.command("SetFrameRate", FrameRate=7)
    bench.command("CaptureImage")
    assert bench.camera_value("FRAMES_PER_SECOND") == 7
    assert written(bench)[-3:] == ["SYNC", "MODE_SELECT", "MODE_SELECT"]
    assert bench.status() is TaskStatus.CAPTURED


@pytest.mark.parametrize("name", ["WriteTo_IS_Register", "WriteCameraRegister"])
def test_an_unanswered_write(bench: Bench, name: str) -> None:
    bench.camera_refuses = lambda _data: True
    bench.command(name)
    assert bench.flags() == {"ConfigChangeError"}


@pytest.mark.parametrize("name", ["ReadFrom_IS_Register", "SelectCameraRegister"])
def test_an_unanswered_read(bench: Bench, name: str) -> None:
    bench.camera_refuses = lambda _data: True
    bench.command(name)
    assert bench.flags() == {"ISSetupError"}
    assert bench.telemetry("CameraRegister")["Valid"] == 0


def test_times_of_the_set_up(bench: Bench) -> None:
    bench.command("CaptureImage")
    set_up, changed = bench.camera_writes[:8], bench.camera_writes[5:8]
    times = bench.telemetry("CameraTiming")
    assert times["SetupTime"] == pytest.approx(
        sum(map(len, set_up)) * CAMERA_BYTE_US / 1000, abs=0.6
    )
    assert times["ExposureUpdateTime"] == pytest.approx(
        sum(map(len, changed)) * CAMERA_BYTE_US / 1000, abs=0.6
    )
    assert times["SetupTime"] > times["ExposureUpdateTime"] > 0
