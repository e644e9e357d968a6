"""Measurements of the comparisons for the page, stored with the code that they depend on."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from cubestack.host.studies.compare.study import Row, Rows
from cubestack.host.studies.compare.tracker import Tracker, tracker, trackers
from cubestack.host.studies.rows.record import load, measurement, save, staleness
from cubestack.host.studies.rows.trace import Noted, Trace
from cubestack.host.studies.workers import performed_afresh

TRACED = 1  #: skies of each case that show what runs


@dataclass(frozen=True)
class Job:
    """A comparison on the skies of one device."""

    study: str
    device: str
    skies: int
    seed: int

    @property
    def key(self) -> str:
        return f"{self.study} {self.device}"

    @property
    def call(self) -> str:
        return f"compare {self.key} --skies {self.skies} --seed {self.seed}"


def perform(job: Job) -> Iterator[Row]:
    """Rows of a job, each when it is done."""
    study = import_module(f"{__package__}.{job.study}.run")
    yield from study.run(tracker(job.device), job.skies, job.seed)


def measured_anew(job: Job) -> tuple[float, list[Row], Noted]:
    """Run a job in this process, which must be a new one: first few skies, to see what runs.

    Returns its processor time in s, its rows, and what ran.
    """
    trace = Trace()
    with trace.running():
        list(perform(Job(job.study, job.device, TRACED, job.seed)))
    started = time.process_time()
    rows = list(perform(job))
    return time.process_time() - started, rows, trace.noted()


def record_file(docs: Path) -> Path:
    return docs / "data" / "compare.json"


def renewed(docs: Path, jobs: Sequence[Job], workers: int) -> Iterator[Job]:
    """Run the jobs and store each as it ends."""
    path = record_file(docs)
    for job, (seconds, rows, noted) in performed_afresh(measured_anew, jobs, workers):
        found = measurement(job.call, seconds, figures(rows), noted.entries())
        save(path, load(path) | {job.key: found})
        yield job


def figures(rows: Sequence[Row]) -> dict[str, float]:
    return {
        f"{row.method}, {row.case}, {name}": value
        for row in rows
        for name, value in row.figures.items()
    }


def stored_rows(docs: Path, study: str) -> dict[str, tuple[Tracker, Rows]]:
    """Trackers and their rows, by device, as far as they were measured."""
    stored = load(record_file(docs))
    return {
        device: (tracker(device), Rows(rows_of(device, stored[f"{study} {device}"].figures)))
        for device in trackers()
        if f"{study} {device}" in stored
    }


def rows_of(device: str, stored: Mapping[str, float]) -> list[Row]:
    by_row: dict[tuple[str, str], dict[str, float]] = {}
    for name, value in stored.items():
        method, case, figure = name.rsplit(", ", 2)  # a method's name may have a comma
        by_row.setdefault((method, case), {})[figure] = value
    return [Row(device, *names, values) for names, values in by_row.items()]


def stale(docs: Path, jobs: Sequence[Job]) -> dict[Job, str]:
    """Jobs that are not stored as they would be measured now, each with the reason."""
    stored = load(record_file(docs))
    reasons = {job: staleness(stored.get(job.key), job.call) for job in jobs}
    return {job: reason for job, reason in reasons.items() if reason}
