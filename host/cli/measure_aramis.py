"""Measure attitudes with AraMiS' star tracker end to end: scene, camera, firmware,
serial line, host.

The star tracker captures and processes every picture; the host sees only what
comes back over the serial line. The truth is known to this command alone and is
printed beside the result. The sky shows all stars that the camera can see. The
first measurement with a lens compiles its catalogue, which takes seconds.

examples:
  cubestack measure aramis --frames 20                       lost in space
  cubestack measure aramis --frames 200 --json > frames.jsonl
  cubestack measure aramis --mode assisted --hint-error 3    rough boresight
  cubestack measure aramis --published --frames 100          as the thesis runs it
  cubestack measure aramis --field 18 --roll-rate 10 --exposure 20
  cubestack measure aramis --bit-flips 1e-6                  upsets in flash
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubestack.host.cli import aramis_session
from cubestack.host.cli.arguments import angle, corner, number, positive, whole
from cubestack.host.cli.fault_plan import add_faults_argument
from cubestack.host.cli.terminal import collect, console

if TYPE_CHECKING:
    from cubestack.host.experiments.aramis import AramisResult

__all__ = ["add_arguments", "run", "summarise"]

SHOWN = 40
NOISE_TERMS = ("shot", "dark", "background", "quantisation", "readout")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    light = parser.add_mutually_exclusive_group()
    light.add_argument("--scene", type=Path, metavar="FILE", help="TOML scene; default: random sky")
    light.add_argument("--image", type=Path, metavar="FILE", help="picture file as the light")
    parser.add_argument("--frames", type=whole(1), default=1, help="number of frames (default 1)")
    parser.add_argument("--seed", type=whole(0), default=0, help="seed of everything random")
    parser.add_argument("--json", action="store_true", help="one JSON object a frame, nothing else")
    parser.add_argument(
        "--mode",
        choices=("lis", "assisted"),
        default="lis",
        help="lost in space (default), or near a rough direction",
    )
    parser.add_argument(
        "--hint-error", type=angle, default=0.0, metavar="DEG", help="largest error of the hint"
    )
    parser.add_argument(
        "--published",
        action="store_true",
        help="believe a unique triangle, as the thesis does, without verification",
    )
    parser.add_argument(
        "--field",
        type=_field,
        default=aramis_session.DEFAULT_FIELD_DEG,
        metavar="DEG",
        help="field of view of lens and catalogue (default 21.5346, the published one)",
    )
    parser.add_argument("--exposure", type=positive, metavar="MS", help="exposure (default 200)")
    parser.add_argument("--gain", type=_gain, metavar="X", help="gain, 1 to 15 (default 15)")
    parser.add_argument(
        "--rate", type=angle, default=0.0, metavar="DEG_S", help="body rate across the boresight"
    )
    parser.add_argument(
        "--roll-rate", type=angle, default=0.0, metavar="DEG_S", help="body rate about it"
    )
    parser.add_argument("--mag-limit", type=number, metavar="V", help="cut the sky there")
    parser.add_argument(
        "--false-stars", type=whole(0), default=0, metavar="N", help="stars in no catalogue"
    )
    parser.add_argument(
        "--false-mags",
        type=_magnitudes,
        default=(4.5, 6.0),
        metavar="V,V",
        help="their brightest and faintest magnitude (default 4.5,6)",
    )
    parser.add_argument("--no-noise", action="store_true", help="a sensor without any noise")
    parser.add_argument(
        "--without",
        action="append",
        choices=NOISE_TERMS,
        default=[],
        help="leave out a term of the noise; may be given again",
    )
    parser.add_argument(
        "--bit-flips",
        type=_rate,
        default=0.0,
        metavar="RATE",
        help="turn over each bit of the catalogue's flash with this probability before each frame",
    )
    parser.add_argument(
        "--crop",
        type=corner,
        default=(0, 0),
        metavar="X,Y",
        help="with --image: left upper corner of the 1280 x 1024 part",
    )
    add_faults_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Measure; returns 0 when every frame was measured, whether solved or not."""
    from cubestack.host.experiments.aramis import measure_frames

    if args.image is None and args.crop != (0, 0):
        raise ValueError("--crop belongs to --image")
    given = args.scene is not None or args.image is not None
    random_sky = (args.mag_limit is not None, args.false_stars, args.no_noise)
    if given and any((*random_sky, args.rate, args.roll_rate)):
        raise ValueError(
            "--mag-limit, --false-stars, --no-noise and rates belong to the random sky; a scene "
            "file has keys for them"
        )
    aramis_session.aramis_catalogue(args.field)  # before anything else shows its progress
    started = time.monotonic()
    results = collect(measure_frames(args), args.frames, as_json=args.json)
    if not args.json:
        _report(results, time.monotonic() - started)
    return 0


def _report(results: list[AramisResult], wall_s: float) -> None:
    from rich.table import Table

    table = Table(title="attitude over the serial line, beside the truth; errors in arcsec")
    for column in ("frame", "right", "stars", "matched", "wrong", "cross", "roll"):
        table.add_column(column, justify="right")
    table.add_column("outcome, reason and error flags", overflow="fold")
    yes_no = {True: "yes", False: "no", None: "-"}
    for index, result in enumerate(results[:SHOWN]):
        table.add_row(
            str(index),
            yes_no[result.right] if result.solved else "no fix",
            str(result.centroids),
            str(result.matched),
            "-" if result.wrong is None else str(result.wrong),
            _arcsec(result.error_cross_deg),
            _arcsec(result.error_roll_deg),
            f"{result.outcome}: {result.reason} {result.status}".rstrip(),
        )
    console.print(table)
    if len(results) > SHOWN:
        console.print(f"... and {len(results) - SHOWN} more; --json lists them all")
    summary = summarise(results)
    console.print(
        f"of {summary['frames']}: {summary['solved_percent']:.1f} % solved, "
        f"{summary['right_percent']:.1f} % right, {wall_s:.1f} s wall time"
    )
    if summary["cross_p95_deg"] is not None:
        console.print(
            f"95th percentile of the right ones: {_arcsec(summary['cross_p95_deg'])} arcsec "
            f"across, {_arcsec(summary['roll_p95_deg'])} about the boresight; "
            f"mean time {summary['total_ms']:.0f} ms"
        )


def _arcsec(degrees: float | None) -> str:
    return "-" if degrees is None else f"{3600 * degrees:.1f}"


def summarise(results: list[AramisResult]) -> dict[str, Any]:
    """Rates in percent of all frames; over the right ones percentiles in degrees, time in ms."""
    import numpy as np

    right = [result for result in results if result.right]
    count = max(1, len(results))

    def percentile(values: list[float | None]) -> float | None:
        known = [abs(value) for value in values if value is not None]
        return float(np.percentile(known, 95)) if known else None

    times = [result.phase_ms["total"] for result in right]
    return {
        "frames": len(results),
        "solved_percent": 100 * sum(result.solved for result in results) / count,
        "right_percent": 100 * len(right) / count,
        "cross_p95_deg": percentile([result.error_cross_deg for result in right]),
        "roll_p95_deg": percentile([result.error_roll_deg for result in right]),
        "total_ms": float(np.mean(times)) if times else None,
    }


def _field(text: str) -> float:
    """Type of a field of view in degrees."""
    return _between(text, 5.0, 40.0, "a field of view in 5..40 degrees")


def _gain(text: str) -> float:
    """Type of a gain."""
    return _between(text, 1.0, 15.0, "a gain in 1..15")


def _rate(text: str) -> float:
    """Type of a probability."""
    return _between(text, 0.0, 1.0, "a probability in 0..1")


def _magnitudes(text: str) -> tuple[float, float]:
    """Type of a range of magnitudes, the brightest first."""
    parts = text.split(",")
    if len(parts) == 2:
        brightest, faintest = number(parts[0]), number(parts[1])
        if brightest <= faintest:
            return brightest, faintest
    raise argparse.ArgumentTypeError(f"{text!r} is not V,V, the brightest first, as in 4.5,6")


def _between(text: str, low: float, high: float, what: str) -> float:
    value = number(text)
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}")
    return value
