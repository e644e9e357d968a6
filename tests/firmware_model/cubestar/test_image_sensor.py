import pytest

from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import TaskStatus

from .harness import CAMERA_BYTE_US, Harness


def written(unit: Harness) -> list[str]:
    registers = [REGISTERS.at(int.from_bytes(data[:2], "big")) for data in unit.camera_writes]
    return [register.name if register else "" for register in registers]


def test_camera_set_up_writes_the_star_settings(unit: Harness) -> None:
    unit.command("CaptureImage")
    assert written(unit) == [
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
    on = {
        name: {f.name for f in REGISTERS[name].fields if f.of(unit.camera_value(name))}
        for name in ("HARDWARE_FEATURES", "FIRMWARE_FEATURES")
    }
    features = {field.name for field in REGISTERS["HARDWARE_FEATURES"].fields}
    assert on["HARDWARE_FEATURES"] == features - {"SHARPENING"}
    assert on["FIRMWARE_FEATURES"] == {"AUTOVIEW"}
    others = ("LINEARITY", "FRAMES_PER_SECOND", "EXPOSURE_RULE", "SYNC")
    assert [unit.camera_value(name) for name in others] == [0, 7, 2, 3]
    mode = REGISTERS["MODE_SELECT"]
    modes = [data[2] for data in unit.camera_writes if data[:2] == b"\x81\x00"]
    assert [mode.field("ENABLE").of(value) for value in modes] == [0, 1, 0]
    assert [mode.field("OUTPUT_DEPTH").of(value) for value in modes] == [1, 1, 1]


def test_camera_set_up_is_written_once_and_again_after_a_change(unit: Harness) -> None:
    unit.command("CaptureImage")
    unit.camera_writes.clear()
    unit.command("CaptureImage")
    assert written(unit) == ["MODE_SELECT", "MODE_SELECT"]
    unit.command("Exposure", exposure=1234)
    unit.command("CaptureImage")
    assert unit.camera_value("EXPOSURE") == 1234
    assert unit.camera_value("EXPOSURE_RULE") == 0
    unit.camera_writes.clear()
    unit.command("MCUReset", "CaptureImage")
    assert written(unit) == ["MODE_SELECT", "MODE_SELECT"]  # the camera kept its registers


@pytest.mark.parametrize("step", range(8))
@pytest.mark.parametrize("change", [False, True])
def test_camera_set_up_can_fail_at_every_step(unit: Harness, change: bool, step: int) -> None:
    if change:
        unit.command("CaptureImage")
        unit.command("SetFrameRate", FrameRate=9)
    messages = []

    def refuse(data: bytes) -> bool:
        messages.append(data)
        return len(messages) == step + 1

    unit.camera_refuses = refuse
    unit.command("CaptureImage")
    assert unit.flags() == {"ConfigChangeError" if change else "ISSetupError"}
    if not change:
        assert len(messages) == step + 1
        unit.command("CaptureImage")
        assert len(written(unit)) == step + 8 + 2  # all of it again
        return
    # Half of it may be written: the old setting must be written too on recovery.
    unit.command("SetFrameRate", FrameRate=7)
    unit.command("CaptureImage")
    assert unit.camera_value("FRAMES_PER_SECOND") == 7
    assert written(unit)[-3:] == ["SYNC", "MODE_SELECT", "MODE_SELECT"]
    assert unit.status() is TaskStatus.CAPTURED


@pytest.mark.parametrize(
    ("name", "flag"),
    [
        ("WriteTo_IS_Register", "ConfigChangeError"),
        ("WriteCameraRegister", "ConfigChangeError"),
        ("ReadFrom_IS_Register", "ISSetupError"),
        ("SelectCameraRegister", "ISSetupError"),
    ],
)
def test_unacknowledged_camera_register_access_raises_its_flag(
    unit: Harness, name: str, flag: str
) -> None:
    unit.camera_refuses = lambda _data: True
    unit.command(name)
    assert unit.flags() == {flag}
    assert unit.telemetry("CameraRegister")["Valid"] == 0


def test_camera_timing_reports_the_set_up_times(unit: Harness) -> None:
    assert not any(unit.telemetry("CameraTiming").values())
    unit.command("CaptureImage")
    set_up, changed = unit.camera_writes[:8], unit.camera_writes[5:8]
    times = unit.telemetry("CameraTiming")
    assert times["SetupTime"] == pytest.approx(
        sum(map(len, set_up)) * CAMERA_BYTE_US / 1000, abs=0.6
    )
    assert times["ExposureUpdateTime"] == pytest.approx(
        sum(map(len, changed)) * CAMERA_BYTE_US / 1000, abs=0.6
    )
    assert times["SetupTime"] > times["ExposureUpdateTime"] > 0
