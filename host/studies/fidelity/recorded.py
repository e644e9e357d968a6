"""Rows of the pages from stored measurements, and which of these are no longer true."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.host.studies.fidelity.table import (
    Job,
    Measured,
    Row,
    chosen_rows,
    fidelity_of,
    filled,
    jobs_of,
    perform,
    rewritten,
    shown,
)
from cubestack.host.studies.fidelity.text import FOLDER
from cubestack.host.studies.rows.record import as_stored, load, measurement, save, staleness
from cubestack.host.studies.rows.trace import Noted, Trace
from cubestack.host.studies.rows.trial import Figures
from cubestack.host.studies.workers import performed_afresh


def record_file(docs: Path, device: str) -> Path:
    """Measurements of a device."""
    return docs / FOLDER / f"{device}.json"


def all_jobs(device: str) -> list[Job]:
    return jobs_of(device, fidelity_of(device).trials)


def rows_of(job: Job) -> list[Row]:
    """Rows with figures of a job."""
    return [row for row in fidelity_of(job.device).rows if row.trial == job.trial]


def measured_anew(job: Job) -> tuple[float, Figures, Noted]:
    """Run a job in this process, which must be a new one: first a few frames, to see what runs.

    Returns its processor time in s, its figures, and what ran.
    """
    trial, trace = fidelity_of(job.device).trials[job.trial], Trace()
    started = _spent_s()
    with trace.running():
        figures = perform(replace(job, frames=trial.quick))
    if job.frames:
        started = _spent_s()
        figures = perform(job)
    return _spent_s() - started, figures, trace.noted()


def _spent_s() -> float:
    """Processor time of this process and of its ended copies."""
    return sum(os.times()[:4])


def renewed(
    docs: Path, jobs: Sequence[Job], workers: int, on_done: Callable[[Job], None]
) -> Iterator[str]:
    """Run the jobs and store each in its device's file; yields values that are no longer the same.

    What a device no longer declares leaves its file.
    """
    order = sorted(jobs, key=lambda job: -job.seconds)
    for job, (seconds, figures, noted) in performed_afresh(measured_anew, order, workers):
        call = fidelity_of(job.device).trials[job.trial].call
        found = measurement(call, seconds, figures, noted.entries())
        path = record_file(docs, job.device)
        stored = load(path)
        if job.key in stored:
            yield from differences(job, stored[job.key].figures, found.figures)
        known = {one.key for one in all_jobs(job.device)}
        save(path, {key: one for key, one in stored.items() if key in known} | {job.key: found})
        on_done(job)


def differences(job: Job, was: Figures, found: Figures) -> Iterator[str]:
    """What a job's rows, or its figures in the text of pages, show otherwise."""
    if was.keys() != found.keys():
        yield f"{job.device} {job.key}: other figures"
        return
    found = as_stored(found)
    rows = rows_of(job)
    for row in rows:
        old, new = shown(row, was), shown(row, found)
        if old != new:
            yield f"{job.device} {row.key}, {job.profile}: {old} is now {new}"
    for name in was if not rows else ():
        old, new = f"{was[name]:.6g}", f"{found[name]:.6g}"
        if old != new:
            yield f"{job.device} {job.key}, {name}: {old} is now {new}"


def stale(docs: Path, devices: Iterable[str]) -> dict[Job, str]:
    """Jobs whose stored measurement is missing or of other code, each with the reason."""
    found = {}
    for device in devices:
        stored = load(record_file(docs, device))
        for job in all_jobs(device):
            call = fidelity_of(device).trials[job.trial].call
            if reason := staleness(stored.get(job.key), call):
                found[job] = reason
    return found


def recorded_rows(docs: Path, device: str) -> list[Measured]:
    """All rows of a device, with the stored values where there are any."""
    stored = load(record_file(docs, device))
    found = {job: stored[job.key].figures for job in all_jobs(device) if job.key in stored}
    return list(filled(device, chosen_rows(device), found))


def pages(docs: Path, device: str) -> dict[Path, str]:
    """Pages with a device's tables, with the stored values in those that have all of them."""
    declared, rows = fidelity_of(device), recorded_rows(docs, device)
    missing = {row.table for row in rows if set(row.ours) != set(PROFILES)}
    found = dict[Path, str]()
    for table in declared.tables:
        path = docs / declared.page_of(table)
        found.setdefault(path, path.read_text("utf-8"))
        if table not in missing:
            own = [row for row in rows if row.table == table]
            found[path] = rewritten(found[path], own)
    return found
