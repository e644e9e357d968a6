"""AraMiS: a sky captured, solved lost in space and near a rough direction, and downloaded."""

import argparse
import time

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.aramis import INTERFACE
from cubestack.host.cli.serving import served
from cubestack.host.cli.terminal import console, progress_bar
from cubestack.host.clients.aramis.client import Aramis, Attitude
from cubestack.host.clients.node import NodeClient
from cubestack.host.experiments.cubestar import compare
from cubestack.host.pictures.images import annotate, save_picture
from cubestack.host.transport.streams import open_transport

__all__ = ["show"]

POINTING_DEG = (84.0, -1.0, 20.0)  # Orion
ROUGHLY_OFF_DEG = 2.0


def show(args: argparse.Namespace) -> bool:
    """Measure twice and download; returns whether both measurements were conclusive."""
    from cubestack.emulator.scene.attitude import matrix_from_quaternion, quaternion_from_pointing

    started = time.monotonic()
    console.rule("star tracker without FPGA: Orion, 21.5 deg, 2026")
    ra, dec, roll = POINTING_DEG
    truth = quaternion_from_pointing(ra, dec, roll)
    scene = args.out / "aramis-sky.toml"
    scene.write_text(
        f'kind = "sky"\nra_deg = {ra}\ndec_deg = {dec}\nroll_deg = {roll}\nseed = {args.seed}\n',
        encoding="utf-8",
    )
    with served("aramis", scene, args.out / "ttyARAMIS") as port:
        aramis = Aramis(
            NodeClient(open_transport(str(port), INTERFACE.baud), INTERFACE, timeout_s=5.0)
        )
        console.print(f"activated; catalogue: {aramis.activate().name.lower()}")
        lost = aramis.measure()
        _report("lost in space", lost, truth)
        boresight = matrix_from_quaternion(truth)[2]
        rough = boresight + np.radians(ROUGHLY_OFF_DEG) * matrix_from_quaternion(truth)[0]
        aided = aramis.measure(rough / np.linalg.norm(rough))
        _report(f"with a direction {ROUGHLY_OFF_DEG:g}° off", aided, truth)
        times = ", ".join(f"{name} {ms:.1f} ms" for name, ms in aramis.phase_times().items())
        console.print(f"  virtual time: {times}", soft_wrap=True)
        stars = aramis.stars()
        with progress_bar() as bar:
            task = bar.add_task("downloading the picture over the serial line", total=None)
            picture = aramis.image(
                lambda done, total: bar.update(task, completed=done, total=total)
            )
        aramis.client.close()
    save_picture(picture, args.out / "aramis-raw.png")
    annotate(picture, stars, args.out / "aramis-stars.png")
    console.print(
        f"{time.monotonic() - started:.1f} s of wall time; "
        f"pictures: {args.out}/aramis-raw.png, {args.out}/aramis-stars.png",
        soft_wrap=True,
    )
    return lost.valid and aided.valid


def _report(title: str, attitude: Attitude, truth: NDArray[np.float64]) -> None:
    outcome = f"{attitude.outcome.name.lower()}: {attitude.reason.name.lower()}"
    if not attitude.valid or attitude.quaternion is None:
        console.print(f"{title}: {outcome}")
        return
    across, about = compare(attitude.quaternion, truth)
    assert across is not None
    assert about is not None
    console.print(
        f"{title}: {outcome}, {attitude.matched} of {attitude.detected} stars; error: "
        f"{3600 * across:.1f} arcsec across, {3600 * about:+.1f} arcsec about the boresight",
        soft_wrap=True,
    )
