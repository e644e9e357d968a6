"""AraMiS: a sky captured, solved lost in space and near a rough direction, and downloaded."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.aramis.board import AramisBoard
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.scene.attitude import matrix_from_quaternion, quaternion_from_pointing
from cubestack.firmware_model.interface.aramis import INTERFACE
from cubestack.firmware_model.interface.aramis.switches import AramisSwitches
from cubestack.host.clients.aramis.client import Aramis, Attitude
from cubestack.host.devices.device import Device
from cubestack.host.experiments.attitude import errors
from cubestack.host.experiments.scene_truth import true_stars
from cubestack.host.pictures.files import DEMO
from cubestack.host.pictures.images import annotate, save_picture
from cubestack.host.studies.demo import Demo, download, tell_times
from cubestack.host.terminal import tell

POINTING_DEG = (84.0, -1.0, 20.0)  # Orion
ROUGHLY_OFF_DEG = 2.0
MOST_STARS = int(INTERFACE.telecommand("SetDetection").reset_values()["MaxStars"])
"""Largest number of stars kept per image."""


def show(
    device: Device[AramisBoard, Aramis],
    out: Path,
    seed: int,
    _photographs: Path | None,
    board: Sequence[str],
) -> bool:
    """Measure twice and download; returns whether both measurements were conclusive."""
    subject = "star tracker without FPGA: Orion, 21.5 deg, 2026"
    demo = Demo(out, "aramis-sky", subject, "aramis-raw.png", "aramis-stars.png")
    ra, dec, roll = POINTING_DEG
    truth = quaternion_from_pointing(ra, dec, roll)
    scene = f'kind = "sky"\nra_deg = {ra}\ndec_deg = {dec}\nroll_deg = {roll}\nseed = {seed}\n'
    with demo.client(device, scene, board) as (aramis, _):
        tell(f"activated; catalogue: {aramis.activate().name.lower()}")
        lost = aramis.measure()
        _report("lost in space", lost, truth)
        boresight = matrix_from_quaternion(truth)[2]
        rough = boresight + np.radians(ROUGHLY_OFF_DEG) * matrix_from_quaternion(truth)[0]
        aided = aramis.measure(rough / np.linalg.norm(rough))
        _report(f"with a direction {ROUGHLY_OFF_DEG:g}° off", aided, truth)
        tell_times(aramis.phase_times(), "  ")
        stars = aramis.stars()
        switches = aramis.profile()
        left_out = [f"all but the {MOST_STARS} brightest"] if len(stars) >= MOST_STARS else []
        if isinstance(switches, AramisSwitches) and switches.belief == "unique":
            left_out.append("names of stars outside the unique triangle")
        picture = download("the picture over the serial line", aramis.image)
    save_picture(picture, out / "aramis-raw.png", DEMO)
    lens = CONDITION.optics.project
    told = true_stars(truth, lens, picture.shape, CONDITION.optics.field_stop_deg / 2)
    title = "AraMiS (star tracker), rendered sky: Orion, 2026"
    annotate(picture, stars, out / "aramis-stars.png", title, left_out, lens, told)
    demo.finish()
    return lost.valid and aided.valid


def _report(title: str, attitude: Attitude, truth: NDArray[np.float64]) -> None:
    outcome = f"{attitude.outcome.name.lower()}: {attitude.reason.name.lower()}"
    if not attitude.valid or attitude.quaternion is None:
        tell(f"{title}: {outcome}")
        return
    across, about = errors(attitude.quaternion, truth)
    tell(
        f"{title}: {outcome}, {attitude.matched} of {attitude.detected} stars; error: "
        f"{3600 * across:.1f} arcsec across, {3600 * about:+.1f} arcsec about the boresight"
    )
