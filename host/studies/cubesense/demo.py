"""CubeSense: the Sun and the Earth measured and their pictures downloaded."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
from cubestack.firmware_model.interface.cubesense.codes import PIXELS_PER_DEGREE, Camera
from cubestack.firmware_model.interface.cubesense.service_port import SERVICE_PORT
from cubestack.host.clients.cubesense.client import CubeSense, Measurement, direction
from cubestack.host.clients.cubesense.download import ServicePortClient
from cubestack.host.devices.device import Device
from cubestack.host.experiments.cubesense.pictures import annotate_nadir, annotate_sun
from cubestack.host.pictures.files import DEMO
from cubestack.host.pictures.images import save_picture
from cubestack.host.studies.demo import ANSWER_TIMEOUT_S, Demo, download, tell_times
from cubestack.host.terminal import tell
from cubestack.host.transport.streams import open_transport

SUN_DEG = (20.0, 10.0)
NADIR_DEG = (-8.0, 12.0)
SUN_TITLE = "CubeSense, sun camera: the Sun through a fisheye lens"
NADIR_TITLE = "CubeSense, nadir camera: the Earth from 750 km through a fisheye lens"
PUBLISHED_MS = {Camera.SUN: 70.4, Camera.NADIR: 245.0}
"""CubeSense thesis, section 7.4: from imaging to centroid, mean of 100; shown beside ours."""


def show(
    device: Device[CubeSenseBoard, CubeSense],
    out: Path,
    seed: int,
    _photographs: Path | None,
    board: Sequence[str],
) -> bool:
    """Measure with both sensors; returns whether both found their target."""
    subject = "sun and nadir sensor: the Sun, and the Earth from 750 km"
    names = (f"{name}{end}.png" for name in ("sun", "nadir") for end in ("-raw", ""))
    demo = Demo(out, "earth-sun", subject, *names)
    scene = (
        f'kind = "earth-sun"\nsun_deg = {list(SUN_DEG)}\nnadir_deg = {list(NADIR_DEG)}\n'
        f"seed = {seed}\n"
    )
    with demo.client(device, scene, board) as (cubesense, port):
        line = open_transport(f"{port}.bench", SERVICE_PORT.baud)
        bench = ServicePortClient(line, timeout_s=ANSWER_TIMEOUT_S)
        found = [
            _measure(cubesense, bench, camera, truth, out)
            for camera, truth in ((Camera.SUN, SUN_DEG), (Camera.NADIR, NADIR_DEG))
        ]
        uptime_s = cubesense.uptime_s()
        line.close()
    demo.finish(uptime_s)
    return all(found)


def _measure(
    cubesense: CubeSense,
    bench: ServicePortClient,
    camera: Camera,
    truth: tuple[float, float],
    out: Path,
) -> bool:
    """Measure with one sensor, report, and write its image; returns whether it found its target."""
    measured = cubesense.capture_and_detect(camera)
    name = camera.name.lower()
    _report(measured, truth, cubesense.phase_times(camera))
    picture = download(
        f"the {name} picture over the bench port", lambda shown: bench.download(camera, shown)
    )
    save_picture(picture, out / f"{name}-raw.png", DEMO)
    _annotate(cubesense, measured, picture, truth, out / f"{name}.png")
    return measured.detected


def _report(measured: Measurement, truth: tuple[float, float], phases_ms: dict[str, float]) -> None:
    name = measured.camera.name.lower()
    if not measured.detected:
        tell(f"{name}: {measured.capture.name}, {measured.detect.name}")
        return
    cosine = float(measured.vector @ direction(*truth))
    error_deg = np.degrees(np.arccos(min(1.0, cosine)))
    tell(
        f"{name}: measured alpha {measured.alpha_deg:+.2f}°, beta {measured.beta_deg:+.2f}°; "
        f"truth {truth[0]:+.2f}°, {truth[1]:+.2f}°; error {error_deg:.3f}°"
    )
    tell_times(phases_ms, "  ")
    tell(f"  published:    {PUBLISHED_MS[measured.camera]} ms from imaging to centroid")


def _annotate(
    cubesense: CubeSense,
    measured: Measurement,
    picture: NDArray[np.uint8],
    truth: tuple[float, float],
    path: Path,
) -> None:
    details = cubesense.details(measured.camera)
    angles = (measured.alpha_deg, measured.beta_deg) if measured.detected else None
    if measured.camera is Camera.SUN:
        first = (int(details["FirstX"]), int(details["FirstY"]))
        annotate_sun(picture, first, angles, path, SUN_TITLE, truth)
        return
    radius_deg = float(details["Radius"]) / PIXELS_PER_DEGREE
    fitted = None if angles is None else (*angles, radius_deg)
    annotate_nadir(picture, cubesense.edges(), fitted, path, NADIR_TITLE, truth)
