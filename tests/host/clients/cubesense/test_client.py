from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.interface.cubesense import INTERFACE, codes
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, Sram
from cubestack.firmware_model.interface.cubesense.telemetry import SCHEDULES
from cubestack.host.clients.cubesense.client import (
    CameraSettings,
    CubeSense,
    Mask,
    Power,
    direction,
)
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.errors import BadAnswerError, CommandRefusedError, NoAnswerError

from ...conftest import LetterLine

FOUND = {"Alpha": 12.34, "Beta": -5.67, "Capture": 2, "Detect": 7}


@pytest.fixture
def cubesense(either_client: NodeClient | I2cClient) -> CubeSense:
    return CubeSense(either_client)


# Requests and answers of real hosts, byte by byte.
IDENTIFICATION = ("1F7F 80 1FFF", "1F7F 05 02 01 03 1000 6400 1FFF")
CAPTURE_AND_DETECT = ("1F7F 14 00 00 1FFF", "1F7F 00 1FFF")
RESULT = ("1F7F 94 1FFF", "1F7F D204 C9FD 02 07 1FFF")
RESULT_THEN_SRAM1 = ("1F7F 96 1FFF", "1F7F D204 C9FD 02 07 1FFF")
SETTINGS = ("1F7F 2D 1F1F 1F1F 1F1F 8080 1FFF", "1F7F 00 1FFF")
NEXT_FRAME = ("1F7F 41 1F1F 00 1FFF", "1F7F 00 1FFF")


@pytest.mark.parametrize(
    ("exchanges", "call", "expected"),
    [
        ([IDENTIFICATION], lambda c: c.uptime_s(), 16.1),
        ([CAPTURE_AND_DETECT, RESULT], lambda c: c.capture_and_detect(Camera.SUN).detected, True),
        ([RESULT_THEN_SRAM1], lambda c: c.result_then_schedule(Camera.SUN).beta_deg, -5.67),
        ([SETTINGS], lambda c: c.set_camera(Camera.NADIR, CameraSettings(0x1F1F, 0x1F)), None),
        ([NEXT_FRAME], lambda c: c.client.command("NextImageFrame", Frame=31), None),
    ],
)
def test_exchanges_have_the_published_bytes(
    exchanges: list[tuple[str, str]], call: Callable[[CubeSense], Any], expected: Any
) -> None:
    wire = {bytes.fromhex(request): bytes.fromhex(answer) for request, answer in exchanges}
    line = LetterLine(**{request.decode("latin-1"): answer for request, answer in wire.items()})
    assert call(CubeSense(NodeClient(line, INTERFACE))) == expected
    assert line.requests == b"".join(wire)


@given(st.floats(0, 99), st.floats(-np.pi, np.pi))
def test_direction_is_the_optical_axis_rotated_by_the_field_angle(theta: float, phi: float) -> None:
    tilt = Rotation.from_rotvec(np.deg2rad(theta) * np.array([-np.sin(phi), np.cos(phi), 0.0]))
    vector = direction(theta * np.cos(phi), theta * np.sin(phi))
    np.testing.assert_allclose(vector, tilt.apply([0.0, 0.0, 1.0]), atol=1e-12)


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("sram", [None, *Sram])
def test_capture_and_detect_returns_the_result(
    cubesense: CubeSense, node: Any, camera: Camera, sram: Sram | None
) -> None:
    node.outcomes[camera] = FOUND
    node.capturing, node.detecting = 3, 5
    found = cubesense.capture_and_detect(camera, sram)
    expected = camera.value if sram is None else sram.value
    assert node.log == [("CaptureAndDetect", {"Camera": camera, "Sram": expected})]
    assert (found.camera, found.alpha_deg, found.beta_deg) == (camera, 12.34, -5.67)
    assert found.capture is CaptureResult.STORED_OWN_SRAM
    assert found.detected
    np.testing.assert_allclose(found.vector, direction(12.34, -5.67))


@pytest.mark.parametrize("detect", [3, 4, 5, 6])
def test_failed_detection_is_returned(cubesense: CubeSense, node: Any, detect: int) -> None:
    node.outcomes[Camera.NADIR] = {"Capture": 3, "Detect": detect}
    found = cubesense.capture_and_detect(Camera.NADIR, Sram.SRAM1)
    assert found.detect is codes.DetectResult(detect)
    assert not found.detected
    assert found.capture.stored


def test_capture_only_returns_the_capture_result(cubesense: CubeSense, node: Any) -> None:
    node.outcomes[Camera.SUN] = {"Capture": 4, "Detect": 1}
    node.capturing = 2
    assert cubesense.capture(Camera.SUN, Sram.SRAM2) is CaptureResult.CAMERA_TIMEOUT
    assert node.log == [("CaptureOnly", {"Camera": 0, "Sram": 1, "Location": 0})]


def test_pending_measurement_times_out(uart: Any, node: Any) -> None:
    cubesense = CubeSense(NodeClient(uart, INTERFACE))
    node.outcomes[Camera.SUN] = {"Capture": 1, "Detect": 2}
    with pytest.raises(NoAnswerError, match="capture of the SUN camera still pending after 3 s"):
        cubesense.capture_and_detect(Camera.SUN)
    assert uart.silences.count(0.04) == 75
    uart.silences.clear()
    node.outcomes[Camera.SUN] = {"Capture": 2, "Detect": 2}
    with pytest.raises(NoAnswerError, match="detection of the SUN camera still pending after 20 s"):
        cubesense.capture_and_detect(Camera.SUN)
    assert uart.silences.count(0.04) == 500


@pytest.mark.parametrize("target", SCHEDULES.values())
def test_reading_result_then_schedule_starts_the_next_measurement(
    cubesense: CubeSense, node: Any, target: tuple[Camera, Sram]
) -> None:
    camera, sram = target
    node.outcomes[camera] = FOUND
    assert cubesense.result_then_schedule(camera, sram).capture is CaptureResult.START_UP
    assert cubesense.wait_measured(camera).alpha_deg == 12.34
    [(name, _)] = node.log
    assert name == f"Result{camera + 1}ThenSram{sram + 1}"


@pytest.mark.parametrize("camera", Camera)
def test_settings_are_sent_for_their_camera(
    cubesense: CubeSense, node: Any, camera: Camera
) -> None:
    number = camera + 1
    cubesense.set_threshold(camera, 99)
    cubesense.set_auto_adjust(camera, True)
    cubesense.set_camera(camera, CameraSettings(300, 4, 5, 6))
    cubesense.set_boresight(camera, 370.25, 240.5)
    settings = {"Exposure": 300, "Gain": 4, "BlueGain": 5, "RedGain": 6}
    assert node.log == [
        (f"DetectionThreshold{number}", {"Threshold": 99}),
        (f"AutoAdjust{number}", {"Enabled": 1}),
        (f"CameraSettings{number}", settings),
        (f"Boresight{number}", {"X": 370.25, "Y": 240.5}),
    ]


@pytest.mark.parametrize("camera", Camera)
def test_settings_are_read_back(cubesense: CubeSense, node: Any, camera: Camera) -> None:
    names = ("Threshold", "AutoAdjust", "Exposure", "Gain", "BlueGain", "RedGain")
    told = zip(names, (70, 1, 0x1F1F, 2, 3, 4), strict=True)
    node.values["Configuration"] = {f"{name}{camera + 1}": value for name, value in told}
    assert cubesense.threshold(camera) == 70
    assert cubesense.auto_adjust(camera) is True
    assert cubesense.camera(camera) == CameraSettings(0x1F1F, 2, 3, 4)
    assert cubesense.threshold(Camera(1 - camera)) == 0


def test_set_distortion_sends_mantissas_and_exponents(cubesense: CubeSense, node: Any) -> None:
    factors = [0.1, 0.99, -7.5e-5, 2.5e-6, 0.0]
    cubesense.set_distortion(Camera.NADIR, factors)
    [(name, values)] = node.log
    assert name == "Distortion2"
    sent = [codes.coefficient(values[f"Mantissa{k}"], values[f"Exponent{k}"]) for k in range(5)]
    assert sent == pytest.approx(factors, rel=1.6e-4)
    with pytest.raises(ValueError, match="a distortion has 5 factors, not 4"):
        cubesense.set_distortion(Camera.SUN, factors[:4])


def test_set_mask_sends_limits_and_masks_reads_them(cubesense: CubeSense, node: Any) -> None:
    cubesense.set_mask(Camera.SUN, 3, Mask(10, 639, 20, 479))
    cubesense.set_mask(Camera.SUN, 3, None)
    limits = {"XMin": 10, "XMax": 639, "YMin": 20, "YMax": 479}
    assert node.log == [
        ("Mask1", {"Area": 3} | limits),
        ("Mask1", {"Area": 3} | dict.fromkeys(limits, 0)),
    ]
    node.values["Masks1"] = {"XMin2": 1, "XMax2": 2, "YMin2": 3, "YMax2": 4}
    assert cubesense.masks(Camera.SUN) == [None, Mask(1, 2, 3, 4), None, None, None]
    for area in (0, 6):
        with pytest.raises(CommandRefusedError, match="Mask1 refused: BAD_PARAMETER"):
            cubesense.set_mask(Camera.SUN, area, None)


def test_power_returns_currents_and_over_current_flags(cubesense: CubeSense, node: Any) -> None:
    currents = {"Current3V3": 12.1, "CurrentSram1": 7.3, "CurrentSram2": 9.4, "Current5V": 71.9}
    node.values["Power"] = currents | {"OverCurrent2": 1}
    assert cubesense.power() == Power(12.1, (7.3, 9.4), 71.9, (False, True))
    cubesense.clear_over_current(codes.SramSelection.SRAM2)
    cubesense.clear_over_current()
    cubesense.reset(codes.ResetTarget.CAMERAS)
    assert node.log == [
        ("ClearOverCurrent", {"Selection": 1}),
        ("ClearOverCurrent", {"Selection": 2}),
        ("Reset", {"Target": 2}),
    ]


def test_client_decodes_serial_number_and_uptime(cubesense: CubeSense, node: Any) -> None:
    node.values["SerialNumber"] = {"SerialNumber": b"CS01\0\0"}
    assert cubesense.serial_number() == "CS01"
    node.values["SerialNumber"] = {"SerialNumber": b"\xff" * 6}
    with pytest.raises(BadAnswerError, match="SerialNumber: ffffffffffff is no ASCII text"):
        cubesense.serial_number()
    node.values["Identification"] = {"RuntimeSeconds": 7, "RuntimeMilliseconds": 250}
    assert cubesense.uptime_s() == 7.25


def test_phase_times_and_details_are_read_per_camera(cubesense: CubeSense, node: Any) -> None:
    node.values["PhaseTimes2"] = {"Store": 33_367, "Total": 245_000}
    times = cubesense.phase_times(Camera.NADIR)
    assert list(times) == ["wait", "store", "search", "centroid", "total"]
    assert (times["store"], times["total"]) == (33.367, 245.0)
    node.values["Details1"] = {"X": -1.25, "Points": 49}
    details = cubesense.details(Camera.SUN)
    assert (details["X"], details["Points"]) == (-1.25, 49)


def test_edges_come_from_both_frames(cubesense: CubeSense, node: Any) -> None:
    assert cubesense.edges().shape == (0, 2)
    node.values["NadirEdges1"] = {"Count": 21, "X1": 12.5, "Y1": 47.0, "X20": 3.25}
    node.values["NadirEdges2"] = {"Count": 21, "X21": 639.0, "Y21": 15.0, "X22": 1.0}
    edges = cubesense.edges()
    assert edges.shape == (21, 2)
    assert edges[[0, 19, 20]].tolist() == [[12.5, 47], [3.25, 0], [639, 15]]
    node.values["NadirEdges1"] = {"Count": 41}
    with pytest.raises(BadAnswerError, match="NadirEdges1: 41 edges, where 40 have room"):
        cubesense.edges()


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("field", ["Capture", "Detect"])
def test_rejects_a_result_with_an_unknown_code(
    cubesense: CubeSense, node: Any, camera: Camera, field: str
) -> None:
    cubesense.capture_and_detect(camera)
    node.outcomes[camera] = {field: 200}
    node._start(camera, detect=True)
    with pytest.raises(BadAnswerError, match=rf"telemetry Result{camera + 1}.*: 200 is not a val"):
        cubesense.result(camera)


@pytest.mark.parametrize("camera", Camera)
def test_quality_rejects_an_unknown_reason(cubesense: CubeSense, node: Any, camera: Camera) -> None:
    values = {"SigmaAlpha": 0.25, "SigmaBeta": 0.5, "Rms": 1.5, "Found": 17, "Reason": 1}
    node.values[f"Quality{camera + 1}"] = values
    found = cubesense.quality(camera)
    assert found.sigma_deg == pytest.approx((0.25, 0.5), rel=0.02)
    assert found.rms_px == pytest.approx(1.5, rel=0.02)
    assert (found.found, found.reason) == (17, codes.Reason(1))
    unknown = max(codes.Reason) + 1
    values["Reason"] = unknown
    with pytest.raises(BadAnswerError, match=f"telemetry Quality{camera + 1}: {unknown}"):
        cubesense.quality(camera)


def test_default_camera_settings_are_those_after_power_up() -> None:
    usual = CameraSettings(exposure=100)
    reset = INTERFACE.telecommand("CameraSettings1").reset_values()
    gains = {"Gain": usual.gain, "BlueGain": usual.blue_gain, "RedGain": usual.red_gain}
    assert gains.items() <= reset.items()
