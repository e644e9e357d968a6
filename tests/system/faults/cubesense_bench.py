"""What the tests of a CubeSense's pictures share."""

from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cubesense.codes import (
    FRAME_BYTES,
    Camera,
    CaptureResult,
    DetectResult,
    ImageLocation,
    ImageSize,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.host.clients.cubesense.client import Measurement

from .bench import NADIR_DEG, SUN_DEG, Bench

FAILED = (CaptureResult.CAMERA_TIMEOUT, DetectResult.NONE_SCHEDULED)

TRUTH_DEG = {Camera.SUN: SUN_DEG, Camera.NADIR: NADIR_DEG}
TARGETS = {Camera.SUN: "sun", Camera.NADIR: "nadir"}


def measure(bench: Bench, camera: Camera = Camera.NADIR) -> Measurement:
    """What the host gets."""
    found: Measurement = bench.device.capture_and_detect(camera)
    return found


def measure_with(bench: Bench, kind: str, **options: Any) -> Measurement:
    """A nadir measurement with a fault of that half, which is cleared then."""
    options.setdefault("target", "nadir")
    found: Measurement = bench.during(kind, lambda: measure(bench), **options)
    return found


def check_right(found: Measurement, *, within_deg: float = 0.1) -> None:
    """The direction is the truth's."""
    assert found.detect is DetectResult.SUCCESS
    truth = TRUTH_DEG[found.camera]
    assert (found.alpha_deg, found.beta_deg) == pytest.approx(truth, abs=within_deg)


def check_next(bench: Bench, camera: Camera = Camera.NADIR) -> None:
    """The next measurement is sound."""
    check_right(measure(bench, camera))


WAIT_S, REQUEST_S = 0.015, 0.003
"""From a request made after ``await_frame`` to its frame; and what it takes at least: the bytes
on the line, and the gap before a frame that the FPGA has to see."""


def await_frame(bench: Bench, camera: Camera = Camera.NADIR) -> RollingShutter:
    """Wait until a request would wait for ``WAIT_S``; the frame that it would store."""
    sensor, kernel = bench.board.cameras[camera], bench.board.kernel
    frame: RollingShutter = sensor.frame_from(kernel.now + round(WAIT_S * PS_PER_S))
    bench.client.pause((frame.readout_ps - kernel.now) / PS_PER_S - WAIT_S)
    assert frame.readout_ps - kernel.now > REQUEST_S * PS_PER_S
    return frame


def line_s(frame: RollingShutter, line: float) -> float:
    """Virtual time at which a frame's line is read out."""
    return float(frame.readout_ps + line * frame.line_ps) / PS_PER_S


def picture(bench: Bench, camera: Camera = Camera.NADIR) -> np.ndarray:
    """What the memory of a camera's half holds, (480, 640); an address is row : column."""
    rows = bench.board.engine.memories[TARGETS[camera]].reshape(-1, 1024)
    held: np.ndarray = rows[: FULL_SIZE.rows, : FULL_SIZE.columns]
    return held.copy()


def host_pixel(bench: Bench, x: int, y: int, sram: Sram = Sram.SRAM2) -> int:
    """A pixel as the host gets it."""
    size = ImageSize.SIDE_1024
    column, row = x + (size.side - FULL_SIZE.columns) // 2, y + (size.side - FULL_SIZE.rows) // 2
    frame, at = divmod(row * size.side + column, FRAME_BYTES)
    client = bench.client
    client.command("StartImageDownload", Sram=sram, Location=ImageLocation.TOP, Size=size)
    client.command("NextImageFrame", Frame=frame)
    for _ in range(50):
        client.pause(0.04)
        if client.telemetry("ImageFrameInfo")["FrameNumber"] == frame:
            return int(bytes(bench.telemetry("ImageFrame")["Frame"])[at])
    pytest.fail(f"frame {frame} is never ready")
