"""Measure directions with CubeSense's sun and nadir sensors end to end.

Each frame gives one result of each sensor, at a random phase of its camera.
Without --scene every result has a random pose of its own: the sun sensor's with
the Sun anywhere within --sun-angle, the nadir sensor's with the Earth's centre
anywhere within --tilt, lit from behind the satellite.

examples:
  cubestack measure cubesense --frames 20
  cubestack measure cubesense --sensor nadir --frames 500 --json > nadir.jsonl
  cubestack measure cubesense --scene earth.toml --json
  cubestack measure cubesense --memory other     through the link of the FPGAs
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubestack.host.cli.arguments import angle, positive, whole
from cubestack.host.cli.fault_plan import add_faults_argument
from cubestack.host.cli.session import add_engine_arguments
from cubestack.host.cli.terminal import collect, console

if TYPE_CHECKING:
    from cubestack.host.experiments.cubesense import SensorResult

__all__ = ["add_arguments", "run", "summarise"]

#: Options of the random pose, with their values when they are not given.
POSE_DEFAULTS = {"tilt": 30.0, "sun_angle": 90.0, "altitude": 750.0, "bloom": 7.0}
SHOWN = 40


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--scene", type=Path, metavar="FILE", help="TOML scene; default: random poses"
    )
    parser.add_argument(
        "--frames", type=whole(1), default=1, help="results of each sensor (default 1)"
    )
    parser.add_argument("--seed", type=whole(0), default=0, help="seed of everything random")
    parser.add_argument(
        "--json", action="store_true", help="one JSON object a result, nothing else"
    )
    parser.add_argument(
        "--sensor", choices=("both", "sun", "nadir"), default="both", help="default: both"
    )
    parser.add_argument(
        "--memory",
        choices=("own", "other"),
        default="own",
        help="SRAM that takes the pictures: the camera's own (default), or the other half's",
    )
    parser.add_argument(
        "--search",
        choices=("lines", "samples", "stepping"),
        default="lines",
        help="how edges are looked for: along lines (published); around samples, by halves or "
        "stepping from pixel to pixel, with FPGAs that let the processor choose addresses",
    )
    parser.add_argument(
        "--tilt", type=angle, metavar="DEG", help="random pose: largest tilt to nadir (30)"
    )
    parser.add_argument(
        "--sun-angle", type=angle, metavar="DEG", help="random pose: largest angle to the Sun (90)"
    )
    parser.add_argument(
        "--altitude", type=positive, metavar="KM", help="random pose: altitude (750)"
    )
    parser.add_argument(
        "--bloom", type=positive, metavar="PX", help="random pose: radius of the Sun's image (7)"
    )
    parser.add_argument("--no-noise", action="store_true", help="random pose: ideal cameras")
    add_faults_argument(parser)
    add_engine_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Measure; returns 0 when every result was read, whether anything was found or not."""
    from cubestack.host.experiments.cubesense import measure_sensors

    given = [name for name in POSE_DEFAULTS if getattr(args, name) is not None]
    if args.scene is not None and (given or args.no_noise):
        names = ", ".join(f"--{name.replace('_', '-')}" for name in (*POSE_DEFAULTS, "no_noise"))
        raise ValueError(f"{names} belong to the random poses; a scene file has keys for them")
    if args.search != "lines" and args.memory == "other":
        raise ValueError(
            f"--search {args.search} reads a camera's own SRAM: leave --memory other out"
        )
    for name, value in POSE_DEFAULTS.items():
        if getattr(args, name) is None:
            setattr(args, name, value)
    count = args.frames * (2 if args.sensor == "both" else 1)
    started = time.monotonic()
    results = collect(measure_sensors(args), count, as_json=args.json)
    if not args.json:
        _report(results, time.monotonic() - started)
    return 0


def _report(results: list[SensorResult], wall_s: float) -> None:
    from rich.table import Table

    table = Table(title="directions over the serial line, beside the truth; degrees")
    for column in ("sensor", "alpha", "truth", "beta", "truth", "error", "points", "ms"):
        table.add_column(column, justify="right")
    table.add_column("result", no_wrap=True)
    for result in results[:SHOWN]:
        points = result.sun_pixels if result.edges is None else result.edges
        table.add_row(
            result.sensor,
            _degrees(result.alpha_deg, 2),
            _degrees(result.truth_alpha_deg, 2),
            _degrees(result.beta_deg, 2),
            _degrees(result.truth_beta_deg, 2),
            _degrees(result.error_deg, 3),
            str(points),
            f"{result.phase_ms['total']:.1f}",
            result.detect if result.capture.startswith("stored") else result.capture,
        )
    console.print(table)
    if len(results) > SHOWN:
        console.print(f"... and {len(results) - SHOWN} more; --json lists them all")
    for sensor in ("sun", "nadir"):
        _report_sensor(sensor, [result for result in results if result.sensor == sensor])
    console.print(f"{wall_s:.1f} s wall time")


def _report_sensor(sensor: str, results: list[SensorResult]) -> None:
    if not results:
        return
    summary = summarise(results)
    text = f"{sensor}: {summary['detected']} of {summary['results']} detected"
    if summary["error_p95_deg"] is not None:
        text += (
            f"; error: mean {summary['error_mean_deg']:.3f}, "
            f"95th percentile {summary['error_p95_deg']:.3f} deg"
            f"; time {summary['total_ms']:.1f} ms"
        )
    console.print(text, soft_wrap=True)


def summarise(results: list[SensorResult]) -> dict[str, Any]:
    """Numbers of results and detections; over the detected ones errors in degrees, time in ms."""
    import numpy as np

    errors = [result.error_deg for result in results if result.error_deg is not None]
    times = [result.phase_ms["total"] for result in results if result.detected]
    return {
        "results": len(results),
        "detected": sum(result.detected for result in results),
        "error_mean_deg": float(np.mean(errors)) if errors else None,
        "error_p95_deg": float(np.percentile(errors, 95)) if errors else None,
        "total_ms": float(np.mean(times)) if times else None,
    }


def _degrees(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
