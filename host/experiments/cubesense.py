"""One measurement of CubeSense: what the host read over the wire, and the truth beside it."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cubestack.firmware_model.interface.cubesense.codes import Camera, NadirSearch, Sram
from cubestack.host.cli.fault_plan import inject_plan
from cubestack.host.cli.session import CubeSenseSession, open_cubesense
from cubestack.host.clients.cubesense.client import Measurement, direction

if TYPE_CHECKING:
    from cubestack.emulator.camera.ov7620.view import EarthSunView
    from cubestack.emulator.scene.earth_sun import SensorTruth

__all__ = ["SensorResult", "measure_sensors"]

#: Names of --search.
SEARCHES = {
    "lines": NadirSearch.LINES,
    "samples": NadirSearch.AROUND_SAMPLES,
    "stepping": NadirSearch.AROUND_SAMPLES_STEPPING,
}

FRAME_S = 525 * 858 / 13.5e6
"""A camera's frame time: captures start at a random phase of it."""


@dataclass(frozen=True)
class SensorResult:
    """Attributes are those of the JSON output; angles in degrees, None where nothing was found.

    Attributes:
        sensor: "sun" or "nadir".
        detected: whether the angles are a measurement.
        alpha_deg, beta_deg: measured angles along the picture's rows and columns.
        truth_alpha_deg, truth_beta_deg: what they should be.
        error_deg: angle between the measured and the true direction.
        edges: edges that the nadir sensor's fit used; None for the sun sensor.
        sun_pixels: pixels of the sun sensor's mean; None for the nadir sensor.
        pixels_read: pixels that the processor read from the FPGA.
        capture, detect: result codes by name.
        phase_ms: virtual times: wait, store, search, centroid, total.
        wall_ms: wall time of the measurement.
    """

    sensor: str
    detected: bool
    alpha_deg: float | None
    beta_deg: float | None
    truth_alpha_deg: float | None
    truth_beta_deg: float | None
    error_deg: float | None
    edges: int | None
    sun_pixels: int | None
    pixels_read: int
    capture: str
    detect: str
    phase_ms: dict[str, float]
    wall_ms: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self.__dict__


def measure_sensors(args: argparse.Namespace) -> Iterator[SensorResult]:
    """Measure ``args.frames`` times with each wanted sensor, as the options say."""
    from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene

    rng = np.random.default_rng(args.seed)
    given = None if args.scene is None else load_earth_sun_scene(args.scene)
    sensors = list(Camera) if args.sensor == "both" else [Camera[args.sensor.upper()]]
    search = SEARCHES[args.search]
    with open_cubesense(
        given or _random_view(args, sensors[0], rng),
        seed=args.seed,
        engine=args.engine,
        mcu_addressing=search is not NadirSearch.LINES,
    ) as session:
        inject_plan(session.board.faults, args.faults)
        if search is not NadirSearch.LINES:
            session.cubesense.client.command("SetNadirSearch", Search=search)
        for _ in range(args.frames):
            for sensor in sensors:
                session.board.scene = given or _random_view(args, sensor, rng)
                session.cubesense.client.pause(float(rng.uniform(0, FRAME_S)))
                sram = Sram(sensor if args.memory == "own" else 1 - sensor)
                yield _measure(session, sensor, sram)


def _random_view(
    args: argparse.Namespace, sensor: Camera, rng: np.random.Generator
) -> EarthSunView:
    """A pose for one sensor: its target anywhere within the given angle, and the Earth at noon."""
    from dataclasses import replace

    from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
    from cubestack.emulator.scene.earth_sun import EarthSunScene

    reach = args.sun_angle if sensor is Camera.SUN else args.tilt
    radius, towards = reach * np.sqrt(rng.random()), 2 * np.pi * rng.random()
    angles = (float(radius * np.cos(towards)), float(radius * np.sin(towards)))
    seed = int(rng.integers(1 << 31))
    if sensor is Camera.SUN:
        scene = EarthSunScene.facing(sun_deg=angles, altitude_km=args.altitude, seed=seed)
        scene = replace(scene, nadir=-np.asarray(scene.sun))
    else:
        scene = EarthSunScene.facing(nadir_deg=angles, altitude_km=args.altitude, seed=seed)
        scene = replace(scene, sun=-np.asarray(scene.nadir))
    condition = FisheyeCondition(bloom_px=args.bloom, noise=not args.no_noise, seed=seed)
    return EarthSunView(scene, condition)


def _measure(session: CubeSenseSession, sensor: Camera, sram: Sram) -> SensorResult:
    cubesense = session.cubesense
    started = time.perf_counter()
    measured = cubesense.capture_and_detect(sensor, sram)
    wall_ms = 1000 * (time.perf_counter() - started)
    truth = session.board.truth(sensor) if measured.capture.stored else None
    visible = truth is not None and truth.visible
    details = cubesense.details(sensor)
    points = int(details["Points"])
    return SensorResult(
        sensor=sensor.name.lower(),
        detected=measured.detected,
        alpha_deg=measured.alpha_deg if measured.detected else None,
        beta_deg=measured.beta_deg if measured.detected else None,
        truth_alpha_deg=truth.alpha_deg if truth and visible else None,
        truth_beta_deg=truth.beta_deg if truth and visible else None,
        error_deg=_error_deg(measured, truth) if visible else None,
        edges=points if sensor is Camera.NADIR else None,
        sun_pixels=points if sensor is Camera.SUN else None,
        pixels_read=int(details["PixelsRead"]),
        capture=measured.capture.name.lower(),
        detect=measured.detect.name.lower(),
        phase_ms=cubesense.phase_times(sensor),
        wall_ms=wall_ms,
    )


def _error_deg(measured: Measurement, truth: SensorTruth | None) -> float | None:
    if truth is None or not measured.detected:
        return None
    vector = direction(measured.alpha_deg, measured.beta_deg)
    # Precise for small angles, which an arc cosine is not.
    sine = float(np.linalg.norm(np.cross(vector, truth.vector)))
    return float(np.degrees(np.arctan2(sine, float(vector @ truth.vector))))
