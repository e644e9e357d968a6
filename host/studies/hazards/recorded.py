"""Measurements of hazards for the page, stored with the code that they depend on."""

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from cubestack.host.experiments.hazard_options import known
from cubestack.host.studies.hazards.curves import Job, Point, perform
from cubestack.host.studies.rows.record import load, measurement, save, staleness
from cubestack.host.studies.rows.trace import Noted, Trace
from cubestack.host.studies.workers import performed_afresh

Curve = tuple[Job, ...]
"""Jobs of one device and hazard, over its strengths."""


def record_file(docs: Path) -> Path:
    return docs / "data" / "hazards.json"


def key(job: Job) -> str:
    """Of a curve in the record."""
    return f"{job.device} {job.hazard}"


def measured_anew(curve: Curve) -> tuple[float, list[Point], Noted]:
    """Measure a curve in this process, which must be a new one: first a frame, to see what runs.

    Returns its processor time in s, its points, and what ran.
    """
    first, trace = curve[0], Trace()
    with trace.running():
        perform(replace(first, strength=known()[first.hazard].strength.usual, frames=1))
    started = time.process_time()
    points = [perform(job) for job in curve]
    return time.process_time() - started, points, trace.noted()


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


def curves_of(jobs: Iterable[Job]) -> list[Curve]:
    found: dict[str, list[Job]] = {}
    for job in jobs:
        found.setdefault(key(job), []).append(job)
    return [tuple(curve) for curve in found.values()]


def renewed(docs: Path, curves: Sequence[Curve], workers: int) -> Iterator[Point]:
    """Measure the curves and store each as it ends."""
    for curve, (seconds, points, noted) in performed_afresh(measured_anew, curves, workers):
        found = measurement(call(curve), seconds, figures(points), noted.entries())
        path = record_file(docs)
        save(path, load(path) | {key(curve[0]): found})
        yield from points


def stale(docs: Path, curves: Iterable[Curve]) -> dict[Curve, str]:
    """Curves whose stored measurement is missing or of other code, each with the reason."""
    stored = load(record_file(docs))
    reasons = {curve: staleness(stored.get(key(curve[0])), call(curve)) for curve in curves}
    return {curve: reason for curve, reason in reasons.items() if reason}
