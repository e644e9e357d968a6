"""What a CubeSense can not have meant is told by the name of the telemetry."""

import pytest

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import EDGES_PER_FRAME, Camera, Reason
from cubestack.host.clients.cubesense.client import CameraSettings, CubeSense
from cubestack.host.clients.node import NodeClient
from cubestack.host.errors import BadAnswerError

from ...conftest import FakeCubeSense, UartLink


@pytest.fixture
def cubesense(sense: FakeCubeSense) -> CubeSense:
    return CubeSense(NodeClient(UartLink(sense), sense.interface))


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.parametrize("field", ["Capture", "Detect"])
def test_a_result_with_a_code_that_there_is_not(
    sense: FakeCubeSense, cubesense: CubeSense, camera: Camera, field: str
) -> None:
    cubesense.capture_and_detect(camera)
    sense.outcomes[camera] = {field: 200}
    sense._start(camera, detect=True)
    with pytest.raises(BadAnswerError, match=rf"telemetry Result{camera + 1}.*: 200 is not"):
        cubesense.result(camera)


@pytest.mark.parametrize("camera", Camera)
def test_a_reason_that_there_is_not(
    sense: FakeCubeSense, cubesense: CubeSense, camera: Camera
) -> None:
    values = {"SigmaAlpha": 0.25, "SigmaBeta": 0.5, "Rms": 1.5, "Found": 17, "Reason": 1}
    sense.values[f"Quality{camera + 1}"] = values
    found = cubesense.quality(camera)
    assert found.sigma_deg == pytest.approx((0.25, 0.5), rel=0.02)
    assert found.rms_px == pytest.approx(1.5, rel=0.02)
    assert (found.found, found.reason) == (17, Reason(1))
    sense.values[f"Quality{camera + 1}"]["Reason"] = max(Reason) + 1
    with pytest.raises(BadAnswerError, match=f"telemetry Quality{camera + 1}: {max(Reason) + 1}"):
        cubesense.quality(camera)


@pytest.mark.parametrize("more", [0, 1])
def test_edges_fill_both_frames_and_no_more(
    sense: FakeCubeSense, cubesense: CubeSense, more: int
) -> None:
    count = 2 * EDGES_PER_FRAME + more
    for number in range(2 * EDGES_PER_FRAME):
        frame = sense.values[f"NadirEdges{1 + number // EDGES_PER_FRAME}"]
        frame |= {"Count": count, f"X{number + 1}": number, f"Y{number + 1}": 2 * number}
    if more:
        with pytest.raises(BadAnswerError, match=f"NadirEdges1: {count} edges, where {count - 1}"):
            cubesense.edges()
        return
    assert cubesense.edges().tolist() == [[n, 2 * n] for n in range(count)]


def test_phase_times_are_in_ms(sense: FakeCubeSense, cubesense: CubeSense) -> None:
    sense.values["PhaseTimes2"] = {"Wait": 1500, "Total": 250_000}
    times = cubesense.phase_times(Camera.NADIR)
    assert (times["wait"], times["total"]) == (1.5, 250.0)


def test_usual_settings_of_a_camera_are_those_after_power_up() -> None:
    usual = CameraSettings(exposure=100)
    reset = INTERFACE.telecommand("CameraSettings1").reset_values()
    assert (usual.gain, usual.blue_gain, usual.red_gain) == (
        *(reset["Gain"], reset["BlueGain"], reset["RedGain"]),
    )
