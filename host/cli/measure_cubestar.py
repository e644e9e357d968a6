"""Measure attitudes of CubeStar end to end: scene, camera, FPGA, firmware, host.

Every frame is captured and processed by the emulated device; the host sees only
what comes back over the serial line. The truth is known to this command alone
and is printed beside the result.

The camera sees more stars than the onboard list has. With all of them in view
the published detection threshold lets many pictures fail; --mag-limit 3.8 cuts
the sky at the list's own limit.

examples:
  cubestack measure cubestar --frames 20 --mag-limit 3.8      lost in space
  cubestack measure cubestar --frames 200 --mag-limit 3.8 --json > frames.jsonl
  cubestack measure cubestar --mode assisted --hint-error 5   rough boresight
  cubestack measure cubestar --image sky.jpg --crop 0,256 --camera camera.json
  cubestack measure cubestar --mag-limit 3.8 --layout 2       one SRAM for FPGA and processor
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubestack.host.cli.arguments import angle, corner, number, whole
from cubestack.host.cli.fault_plan import add_faults_argument
from cubestack.host.cli.session import add_engine_arguments, add_layout_argument, tell_layout
from cubestack.host.cli.terminal import collect, console, say

if TYPE_CHECKING:
    from cubestack.host.experiments.cubestar import FrameResult

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    light = parser.add_mutually_exclusive_group()
    light.add_argument("--scene", type=Path, metavar="FILE", help="TOML scene; default: random sky")
    light.add_argument("--image", type=Path, metavar="FILE", help="picture file as the light")
    parser.add_argument("--frames", type=whole(1), default=1, help="number of frames (default 1)")
    parser.add_argument(
        "--seed", type=whole(0), default=0, help="seed of poses, noise and hints (default 0)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a frame, nothing else")
    parser.add_argument(
        "--mode",
        choices=("lis", "assisted", "tracking"),
        default="lis",
        help="lost in space (default), assisted match, or tracking",
    )
    parser.add_argument(
        "--hint-error",
        type=angle,
        default=0.0,
        metavar="DEG",
        help="largest error of the hint (assisted) or of the last attitude (tracking)",
    )
    parser.add_argument(
        "--mag-limit",
        type=number,
        metavar="V",
        help="cut the sky at this magnitude; default: all that the camera can see",
    )
    parser.add_argument(
        "--false-stars",
        type=whole(0),
        default=0,
        metavar="N",
        help="stars that are in no catalogue, at random places",
    )
    parser.add_argument("--no-noise", action="store_true", help="a sensor without any noise")
    parser.add_argument(
        "--crop",
        type=corner,
        default=(0, 0),
        metavar="X,Y",
        help="with --image: left upper corner of the 1024 x 512 part",
    )
    parser.add_argument(
        "--camera",
        type=Path,
        metavar="FILE",
        help="with --image: JSON with the camera's f_px, cx_px, cy_px, k1, k2, p1, p2",
    )
    add_faults_argument(parser)
    add_engine_arguments(parser)
    add_layout_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Measure; returns 0 when every frame was measured, whether solved or not."""
    from cubestack.host.experiments.cubestar import measure_frames

    if args.image is None and (args.camera or args.crop != (0, 0)):
        raise ValueError("--crop and --camera belong to --image")
    sky_options = args.mag_limit is not None or args.false_stars or args.no_noise
    if sky_options and (args.image or args.scene):
        raise ValueError(
            "--mag-limit, --false-stars and --no-noise belong to the random sky; a scene file "
            "has the keys mag_limit, false_stars and noise"
        )
    if not args.json:
        tell_layout(args.layout, say)
    started = time.monotonic()
    results = collect(measure_frames(args), args.frames, as_json=args.json)
    if not args.json:
        _report(results, time.monotonic() - started)
    return 0


def _report(results: list[FrameResult], wall_s: float) -> None:
    from rich.table import Table

    table = Table(title="attitude over the serial line, beside the truth; errors in arcsec")
    for column in ("frame", "right", "stars", "matched", "wrong", "cross", "roll"):
        table.add_column(column, justify="right")
    table.add_column("status and error flags", overflow="fold")
    for index, result in enumerate(results[:40]):
        table.add_row(*_row(index, result))
    console.print(table)
    if len(results) > 40:
        console.print(f"... and {len(results) - 40} more; --json lists them all")
    summary = summarise(results)
    console.print(
        f"of {summary['frames']}: {summary['solved_percent']:.1f} % solved, "
        f"{summary['right_percent']:.1f} % right, {wall_s:.1f} s wall time"
    )
    if summary["cross_p95_deg"] is not None:
        console.print(
            f"95th percentile of the right ones: {_arcsec(summary['cross_p95_deg'])} arcsec "
            f"across, {_arcsec(summary['roll_p95_deg'])} about the boresight"
        )


def _row(index: int, result: FrameResult) -> list[str]:
    yes_no = {True: "yes", False: "no", None: "-"}
    return [
        str(index),
        yes_no[result.right] if result.solved else "no fix",
        str(result.centroids),
        str(result.matched),
        "-" if result.wrong is None else str(result.wrong),
        _arcsec(result.error_cross_deg),
        _arcsec(result.error_roll_deg),
        result.status,
    ]


def _arcsec(degrees: float | None) -> str:
    return "-" if degrees is None else f"{3600 * degrees:.1f}"


def summarise(results: list[FrameResult]) -> dict[str, Any]:
    """Rates in percent of all frames, and percentiles over the right ones in degrees."""
    import numpy as np

    right = [result for result in results if result.right]
    count = max(1, len(results))

    def percentile(values: list[float | None]) -> float | None:
        known = [abs(value) for value in values if value is not None]
        return float(np.percentile(known, 95)) if known else None

    return {
        "frames": len(results),
        "solved_percent": 100 * sum(result.solved for result in results) / count,
        "right_percent": 100 * len(right) / count,
        "cross_p95_deg": percentile([result.error_cross_deg for result in right]),
        "roll_p95_deg": percentile([result.error_roll_deg for result in right]),
    }
