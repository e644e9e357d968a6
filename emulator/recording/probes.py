"""What a trace looks at in a board's firmware: variables of the running program, by name."""

from collections.abc import Callable
from typing import Any

from cubestack.emulator.recording.trace import Probe
from cubestack.firmware_model.interface.aramis.codes import MeasurementOutcome, SensorState
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, DetectResult
from cubestack.firmware_model.interface.cubestar.codes import TaskStatus

__all__ = ["firmware_probes"]


def firmware_probes(board: Any) -> dict[str, Probe]:
    """Probes for ``board``: the processor's, and the task state of a program that is known."""
    processor = board.processor
    probes: dict[str, Probe] = {
        "awake": lambda: int(not processor.dozing),
        "resets": lambda: int(processor.resets),
    }
    state = getattr(board.program, "state", None)
    if hasattr(state, "task_status"):
        probes["task"] = lambda: TaskStatus(board.program.state.task_status).name
    if hasattr(state, "sensor"):
        probes["task"] = lambda: SensorState(board.program.state.sensor).name
        probes["measurement"] = lambda: (
            MeasurementOutcome(board.program.state.measurement.outcome).name
        )
    if hasattr(state, "results"):
        for camera in Camera:
            probes |= _camera_probes(camera, lambda: board.program.state)
    return probes


def _camera_probes(camera: Camera, state: Callable[[], Any]) -> dict[str, Probe]:
    return {
        f"{camera.name.lower()}_capture": lambda: (
            CaptureResult(state().results[camera].capture).name
        ),
        f"{camera.name.lower()}_detect": lambda: DetectResult(state().results[camera].detect).name,
    }
