"""One measurement of AraMiS: what the host read over the wire, and the truth beside it."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.aramis import OnOff, SpikeMethod
from cubestack.firmware_model.interface.cameras.mt9m001 import (
    COLUMNS,
    FRAME_END_CLOCKS,
    FRAME_START_CLOCKS,
    PIXEL_CLOCK_HZ,
)
from cubestack.host.cli.aramis_session import AramisSession, open_aramis
from cubestack.host.cli.fault_plan import inject_plan
from cubestack.host.clients.aramis.client import Attitude
from cubestack.host.experiments.cubestar import RIGHT_CROSS_DEG, RIGHT_ROLL_DEG, compare

if TYPE_CHECKING:
    from cubestack.emulator.camera.common.view import SkyCondition, SkyView
    from cubestack.emulator.camera.mt9m001.noise import NoiseTerms
    from cubestack.emulator.scene.sky import Scene

__all__ = ["AramisResult", "measure_frames"]

ROW_S = (COLUMNS + FRAME_START_CLOCKS + FRAME_END_CLOCKS) / PIXEL_CLOCK_HZ
SAME_STAR_DEG = 0.2
"""An identified star further than this from where the truth puts it has a wrong identity."""

PHASE_S = 0.2
"""Measurements start at a random time within so long after each other."""


@dataclass(frozen=True)
class AramisResult:
    """Attributes are those of the JSON output; angles in degrees, None where there is no truth.

    Attributes:
        solved: the measurement gave an attitude.
        right: it did, and the attitude is right; None without truth.
        outcome, reason: how the identification ended.
        centroids, matched: stars found, and stars that the attitude rests on.
        wrong: identified stars with a wrong identity.
        candidates, pivots, triples: of the identification.
        mode: "lis" or "assisted".
        flips, corrected, lost: bits turned over in flash, and what loading made of the words.
        image_time_s: mid-exposure by the star tracker's clock, since power-up.
        phase_ms: virtual time of each step; wall_ms is wall time.
        status: names of the error flags.
    """

    solved: bool
    right: bool | None
    outcome: str
    reason: str
    centroids: int
    matched: int
    wrong: int | None
    candidates: int
    pivots: int
    triples: int
    mode: str
    error_cross_deg: float | None
    error_roll_deg: float | None
    truth: list[float] | None
    quaternion: list[float] | None
    image_time_s: float
    flips: int
    corrected: int
    lost: int
    phase_ms: dict[str, float]
    wall_ms: float
    status: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self.__dict__


def measure_frames(args: argparse.Namespace) -> Iterator[AramisResult]:
    """Measure ``args.frames`` times as the options of `cubestack measure aramis` say."""
    from cubestack.emulator.camera.common.view import SkyCondition
    from cubestack.emulator.camera.mt9m001.lens import double_gauss

    rng = np.random.default_rng(args.seed)
    condition = SkyCondition(double_gauss(args.field))
    view = _view(args, condition, rng)
    with open_aramis(
        view, seed=args.seed, field_deg=args.field, noise=_noise(args.without)
    ) as session:
        inject_plan(session.board.faults, args.faults)
        _configure(session, args)
        session.aramis.activate()
        pristine = session.board.catalogue_flash.copy()
        for number in range(args.frames):
            if number and args.scene is None and args.image is None:
                view = _view(args, condition, rng)
                session.board.camera.scene = view
            flips = 0
            if args.bit_flips:
                session.aramis.deactivate()
                session.board.catalogue_flash[:] = pristine
                flips = session.board.irradiate("flash", args.bit_flips)
                session.aramis.activate()
            session.aramis.client.pause(float(rng.uniform(0, PHASE_S)))
            yield _measure(session, args, view.scene, rng, flips)


def _view(args: argparse.Namespace, condition: SkyCondition, rng: np.random.Generator) -> SkyView:
    from cubestack.emulator.camera.common.scene_file import load_scene
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.scene.attitude import random_quaternion
    from cubestack.emulator.scene.sky import PictureScene, SkyScene

    if args.scene is not None:
        return load_scene(args.scene, condition)
    if args.image is not None:
        return SkyView(PictureScene(args.image, crop=args.crop), condition)
    along = rng.random() * 2 * np.pi
    rate = (args.rate * np.cos(along), args.rate * np.sin(along), args.roll_rate)
    scene = SkyScene(
        quaternion=random_quaternion(rng),
        rate_deg_s=rate,
        mag_limit=args.mag_limit,
        false_stars=args.false_stars,
        false_star_mag=args.false_mags,
        seed=int(rng.integers(1 << 31)),
    )
    return SkyView(scene, replace(condition, noise=not args.no_noise, seed=scene.seed))


def _noise(without: list[str]) -> NoiseTerms:
    from cubestack.emulator.camera.mt9m001.noise import NoiseTerms

    return NoiseTerms(**dict.fromkeys(without, False))


def _configure(session: AramisSession, args: argparse.Namespace) -> None:
    """Send what differs from the settings after power-up."""
    client = session.aramis.client
    interface = client.interface
    client.command("SetField", FieldOfView=args.field, Round=OnOff.ON)
    if args.exposure is not None:
        client.command("SetExposure", Rows=max(1, round(args.exposure / 1000 / ROW_S)))
    if args.gain is not None:
        client.command("SetGain", Gain=args.gain)
    client.wait_processed(1.0)
    if args.published:
        detection = interface.telecommand("SetDetection").reset_values()
        detection |= {"Spikes": SpikeMethod.WINDOW, "Subtract": OnOff.OFF}
        client.command("SetDetection", **detection)
        matching = interface.telecommand("SetIdentification").reset_values()
        client.command("SetIdentification", **(matching | {"Verify": OnOff.OFF, "Noise": 0.26}))
        client.wait_processed(1.0)


def _measure(
    session: AramisSession,
    args: argparse.Namespace,
    scene: Scene,
    rng: np.random.Generator,
    flips: int,
) -> AramisResult:
    started = time.perf_counter()
    aramis, client = session.aramis, session.aramis.client
    client.command("ClearErrorFlags")
    hint = None
    if args.mode == "assisted":
        known = scene.truth(session.board.kernel.now)
        if known is None:
            raise ValueError("--mode assisted needs a scene whose attitude is known")
        hint = _hint(known, args.hint_error, rng)
    found = aramis.measure(hint)
    truth = session.board.truth(found.frame)
    cross = roll = None
    if found.valid and found.quaternion is not None:
        cross, roll = compare(found.quaternion, truth)
    summary = client.telemetry("IdentificationSummary")
    catalogue = client.telemetry("CatalogueStatus")
    flags = client.telemetry("ErrorFlags")
    return AramisResult(
        solved=found.valid,
        right=None if truth is None else _is_right(cross, roll),
        outcome=found.outcome.name.lower(),
        reason=found.reason.name.lower(),
        centroids=found.detected,
        matched=found.matched if found.valid else 0,
        wrong=_count_wrong(session, truth) if found.valid else 0,
        candidates=int(summary["Candidates"]),
        pivots=int(summary["Pivots"]),
        triples=int(summary["Triples"]),
        mode=args.mode,
        error_cross_deg=cross,
        error_roll_deg=roll,
        truth=None if truth is None else [float(part) for part in truth],
        quaternion=_listed(found),
        image_time_s=found.image_uptime_s,
        flips=flips,
        corrected=int(catalogue["Corrected"]),
        lost=int(catalogue["Lost"]),
        phase_ms=aramis.phase_times(),
        wall_ms=1000 * (time.perf_counter() - started),
        status=" ".join(name for name, up in flags.items() if up),
    )


def _listed(found: Attitude) -> list[float] | None:
    if not found.valid or found.quaternion is None:
        return None
    return [float(part) for part in found.quaternion]


def _is_right(cross: float | None, roll: float | None) -> bool:
    if cross is None or roll is None:
        return False
    return cross < RIGHT_CROSS_DEG and abs(roll) < RIGHT_ROLL_DEG


def _hint(
    truth: NDArray[np.float64], error_deg: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """A boresight (3,) that is at most ``error_deg`` off, uniform over that cap."""
    from cubestack.emulator.scene.attitude import matrix_from_quaternion

    matrix = matrix_from_quaternion(truth)
    away = np.radians(error_deg) * np.sqrt(rng.random())
    side = rng.random() * 2 * np.pi
    across = np.cos(side) * matrix[0] + np.sin(side) * matrix[1]
    return np.asarray(np.cos(away) * matrix[2] + np.sin(away) * across, np.float64)


def _count_wrong(session: AramisSession, truth: NDArray[np.float64] | None) -> int | None:
    """Identified stars that the truth puts elsewhere; None without a truth."""
    from cubestack.emulator.scene.attitude import matrix_from_quaternion
    from cubestack.emulator.scene.hipparcos import load_sky
    from cubestack.emulator.scene.sky import SkyScene

    camera = session.board.camera
    if truth is None or not isinstance(camera.scene, SkyScene):
        return None
    named = [star for star in session.aramis.stars() if star.hipparcos is not None]
    if not named:
        return 0
    sky = load_sky()
    rows = np.searchsorted(sky.hip, [star.hipparcos or 0 for star in named])
    expected = sky.vectors[rows] @ matrix_from_quaternion(truth).T
    lens = camera.condition.optics
    measured = lens.unproject(np.array([[star.x_px, star.y_px] for star in named]))
    cosines = np.clip(np.sum(expected * measured, axis=1), -1, 1)
    return int(np.sum(np.degrees(np.arccos(cosines)) > SAME_STAR_DEG))
