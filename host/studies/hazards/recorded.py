"""Measurements of hazards for the page, stored with the code that they depend on."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from cubestack.host.experiments.hazard_options import known
from cubestack.host.studies.hazards.curves import Job, Point, perform
from cubestack.host.studies.rows.record import Measurement, load, measurement, save
from cubestack.host.studies.rows.trace import Trace
from cubestack.host.studies.workers import performed_afresh

Curve = tuple[Job, ...]
"""Jobs of one device and hazard, over its strengths."""


def record_file(docs: Path) -> Path:
    return docs / "data" / "hazards.json"


def key(job: Job) -> str:
    """Of a curve in the record."""
    return f"{job.device} {job.hazard}"


def measured_anew(curve: Curve) -> tuple[list[Point], Measurement]:
    """Measure a curve in this process, which must be a new one: first a frame, to see what runs."""
    first, trace = curve[0], Trace()
    with trace.running():
        perform(replace(first, strength=known()[first.hazard].strength.usual, frames=1))
    started = time.process_time()
    points = [perform(job) for job in curve]
    seconds = time.process_time() - started
    return points, measurement(call(curve), seconds, figures(points), trace.entries())


def call(curve: Curve) -> str:
    one = curve[0]
    return (
        f"hazards {one.device} --hazard {one.hazard} --frames {one.frames} --seed {one.seed} "
        f"--profile {one.profile}"
    )


def figures(points: Sequence[Point]) -> dict[str, float]:
    """Numbers of images by strength and outcome."""
    return {
        f"{point.strength:g} {outcome}": float(getattr(point, outcome))
        for point in points
        for outcome in ("right", "refused", "wrong")
    }


def renewed(docs: Path, jobs: Sequence[Job], workers: int) -> Iterator[Point]:
    """Measure all curves of the jobs and store each as it ends."""
    curves: dict[str, list[Job]] = {}
    for job in jobs:
        curves.setdefault(key(job), []).append(job)
    every = [tuple(curve) for curve in curves.values()]
    for curve, (points, found) in performed_afresh(measured_anew, every, workers):
        path = record_file(docs)
        save(path, load(path) | {key(curve[0]): found})
        yield from points


def stale(docs: Path) -> dict[str, list[str]]:
    """Stored curves whose code has changed, with the files."""
    stored = load(record_file(docs))
    return {name: one.changed for name, one in stored.items() if one.changed}
