"""CubeSense: the Sun and the Earth measured and their pictures downloaded."""

import argparse
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import PIXELS_PER_DEGREE, Camera
from cubestack.firmware_model.interface.cubesense.service_port import SERVICE_PORT
from cubestack.host.cli.serving import served
from cubestack.host.cli.terminal import console, progress_bar
from cubestack.host.clients.cubesense.client import CubeSense, Measurement, direction
from cubestack.host.clients.cubesense.service_port import ServicePortClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.pictures.cubesense import annotate_nadir, annotate_sun
from cubestack.host.pictures.images import save_picture
from cubestack.host.transport.streams import open_transport

__all__ = ["show"]

SUN_DEG = (20.0, 10.0)
NADIR_DEG = (-8.0, 12.0)
PUBLISHED_MS = {Camera.SUN: 70.4, Camera.NADIR: 245.0}
"""CubeSense thesis, section 7.4: from imaging to centroid, mean of 100."""


def show(args: argparse.Namespace) -> bool:
    """Measure with both sensors; returns whether both found what they looked for."""
    started = time.monotonic()
    console.rule("sun and nadir sensor: the Sun, and the Earth from 750 km")
    scene = args.out / "earth-sun.toml"
    scene.write_text(
        f'kind = "earth-sun"\nsun_deg = {list(SUN_DEG)}\nnadir_deg = {list(NADIR_DEG)}\n'
        f"seed = {args.seed}\n",
        encoding="utf-8",
    )
    with served("cubesense", scene, args.out / "ttyCUBESENSE") as port:
        cubesense = CubeSense(NodeClient(open_transport(str(port), INTERFACE.baud), INTERFACE))
        line = open_transport(f"{port}.bench", SERVICE_PORT.baud)
        bench = ServicePortClient(line)
        found = [
            _measure(cubesense, bench, camera, truth, args.out)
            for camera, truth in ((Camera.SUN, SUN_DEG), (Camera.NADIR, NADIR_DEG))
        ]
        uptime_s = cubesense.uptime_s()
        line.close()
        cubesense.client.close()
    console.print(
        f"{uptime_s:.1f} s of virtual time in {time.monotonic() - started:.1f} s of wall time; "
        f"pictures: {args.out}/sun.png, {args.out}/nadir.png",
        soft_wrap=True,
    )
    return all(found)


def _measure(
    cubesense: CubeSense,
    bench: ServicePortClient,
    camera: Camera,
    truth: tuple[float, float],
    out: Path,
) -> bool:
    """Measure with one sensor, report, and write its picture; returns whether it found it."""
    measured = cubesense.capture_and_detect(camera)
    name = camera.name.lower()
    _report(measured, truth, cubesense.phase_times(camera))
    with progress_bar() as bar:
        task = bar.add_task(f"downloading the {name} picture over the bench port", total=None)
        picture = bench.download(
            camera, lambda done, total: bar.update(task, completed=done, total=total)
        )
    save_picture(picture, out / f"{name}-raw.png")
    _annotate(cubesense, measured, picture, out / f"{name}.png")
    return measured.detected


def _report(measured: Measurement, truth: tuple[float, float], phases_ms: dict[str, float]) -> None:
    name = measured.camera.name.lower()
    if not measured.detected:
        console.print(f"{name}: {measured.capture.name}, {measured.detect.name}")
        return
    cosine = float(measured.vector @ direction(*truth))
    error_deg = np.degrees(np.arccos(min(1.0, cosine)))
    console.print(
        f"{name}: measured alpha {measured.alpha_deg:+.2f}°, beta {measured.beta_deg:+.2f}°; "
        f"truth {truth[0]:+.2f}°, {truth[1]:+.2f}°; error {error_deg:.3f}°",
        soft_wrap=True,
    )
    times = ", ".join(f"{phase} {ms:.1f} ms" for phase, ms in phases_ms.items())
    console.print(f"  virtual time: {times}", soft_wrap=True)
    console.print(f"  published:    {PUBLISHED_MS[measured.camera]} ms from imaging to centroid")


def _annotate(
    cubesense: CubeSense, measured: Measurement, picture: NDArray[np.uint8], path: Path
) -> None:
    details = cubesense.details(measured.camera)
    angles = (measured.alpha_deg, measured.beta_deg) if measured.detected else None
    if measured.camera is Camera.SUN:
        first = (int(details["FirstX"]), int(details["FirstY"]))
        annotate_sun(picture, first, angles, path)
        return
    radius_deg = float(details["Radius"]) / PIXELS_PER_DEGREE
    fitted = None if angles is None else (*angles, radius_deg)
    annotate_nadir(picture, cubesense.edges(), fitted, path)
