"""AraMiS' published figures (thesis, Politecnico di Torino, 2008) and their trials."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cubestack.emulator.boards.aramis.catalogue import (
    CatalogueParameters,
    cached_database,
    onboard_database,
)
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.aramis.matching.triangles import measure_triangle
from cubestack.firmware_model.aramis.matching.triples import (
    BOUND_SIGMAS,
    find_triangles,
    match_triple,
)
from cubestack.firmware_model.aramis.solution import Profile
from cubestack.firmware_model.interface.aramis import IMAGE_BYTES
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533, LIBRARIES
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.experiments.aramis.measure import AramisOpener, AramisResult
from cubestack.host.experiments.measure import measure
from cubestack.host.studies.aramis.printed import bounds, spikes
from cubestack.host.studies.aramis.stars_alone import stars_alone
from cubestack.host.studies.fidelity.table import Fidelity, read_tables
from cubestack.host.studies.hazards.overview import skies
from cubestack.host.studies.rows.estimate import average, rate
from cubestack.host.studies.rows.trial import Figures, Trial, measured, measured_in_turn

EPOCH = 2000.0  # of the thesis' catalogue
FIELDS_DEG = (*range(5, 14), 15, 17, 18, 19, 21, 25, 30, 35, 40)
LOOKUP_SEED = 1
STARS = 6
"""Of a field: the main triangle and three pivots (section 5.7)."""


def _attitudes(results: Sequence[AramisResult]) -> Figures:
    """Rates in percent; errors of the right ones in arcsec; mean times in ms."""
    right = [result for result in results if result.right]
    errors = {
        axis: [3600 * abs(getattr(result, f"error_{axis}_deg")) for result in right] or [np.nan]
        for axis in ("cross", "roll")
    }
    return {
        "right": rate(r.right for r in results),
        "wrong": rate(r.solved and not r.right for r in results),
        "far": rate(bool(r.far) for r in results),
        "conclusive": rate(r.solved for r in results),
        "ambiguous": rate(r.outcome == "ambiguous" for r in results),
        "none": rate(r.outcome == "none" for r in results),
        "cross": average(errors["cross"]),
        "cross95": float(np.percentile(errors["cross"], 95)),
        "roll95": float(np.percentile(errors["roll"], 95)),
    }


def _catalogue(_opened: AramisOpener, _frames: int) -> Figures:
    """Stars and triangles of the published selection, and of its two variants."""
    figures: dict[str, float] = {}
    variants = {"six": CatalogueParameters(epoch=EPOCH)}
    variants["five"] = CatalogueParameters(epoch=EPOCH, stars_per_field=5)
    variants["narrow"] = CatalogueParameters(epoch=EPOCH, fov_deg=18.0)
    for name, parameters in variants.items():
        database = cached_database(parameters)
        figures[f"{name}_stars"] = len(database.numbers)
        figures[f"{name}_triangles"] = len(database)
        figures[f"{name}_mb"] = len(database.pack()) / 1e6
    return {**figures, "picture": IMAGE_BYTES / 2**20}


def _fields(_opened: AramisOpener, _frames: int) -> Figures:
    """The database of each field of view."""
    figures: dict[str, float] = {}
    for field_deg in FIELDS_DEG:
        database = onboard_database(field_deg)
        figures[f"{field_deg} stars"] = len(database.numbers)
        figures[f"{field_deg} triangles"] = len(database)
        figures[f"{field_deg} bytes"] = sum(database.sizes.values())
    return figures


def _lookups(_opened: AramisOpener, frames: int) -> Figures:
    """Triangles found by area, by moment, by both, and after one pivot.

    Stars of random fields without noise, with the bounds of appendix E; means of main triangles.
    """
    rng, meter = np.random.default_rng(LOOKUP_SEED), Meter(BLACKFIN_BF533)
    database, sigma_rad = onboard_database(), Profile().sigma_rad
    sky = load_sky(mag_limit=6.0)
    counts: list[tuple[int, ...]] = []
    while len(counts) < frames:
        boresight = rng.normal(size=3)
        near = sky.vectors @ boresight / np.linalg.norm(boresight)
        seen = np.flatnonzero(near > np.cos(np.radians(database.fov_deg / 2)))
        vectors = sky.vectors[seen[np.argsort(sky.v_mag[seen])[:STARS]]].astype(np.float32)
        triangle = (
            measure_triangle(vectors[:3], sigma_rad, meter) if len(vectors) >= STARS else None
        )
        if triangle is None:
            continue
        area, moment = (BOUND_SIGMAS * s for s in (triangle.area_sigma, triangle.moment_sigma))
        areas, moments = (
            np.diff(np.searchsorted(values, (middle - reach, middle + reach)))[0]
            for values, middle, reach in (
                (database.areas, triangle.area, area),
                (database.moments, triangle.moment, moment),
            )
        )
        both = find_triangles(triangle, database, None, meter)
        pivoted = match_triple(vectors, (0, 1, 2), (3,), sigma_rad, database, None, meter, None)
        counts.append((areas, moments, len(both), len(pivoted.candidates)))
    names = ("area", "moment", "both", "pivot")
    return dict(zip(names, map(average, np.array(counts).T), strict=True))


def _checks(results: Sequence[AramisResult]) -> Figures:
    """Check of the catalogue in RAM before each measurement: mean and longest in ms."""
    checks = [float(result.phase_ms["check"]) for result in results]
    return {
        "check": average(checks),
        "longest": max(checks),
        "right": rate(r.right for r in results),
    }


def _switched(summary: Any, frames: int, quick: int, seconds: float, **options: Any) -> Trial:
    """A trial with some switches set, in profile `published`."""
    return replace(
        measured("aramis", summary, frames, quick, seconds, extremes=("longest",), **options),
        profiles=False,
    )


def _in_ram(protection: str) -> Trial:
    return _switched(_checks, 60, 2, 5, ram_flips=1e-8, set=f"ram={protection}")


def _moving(results: Sequence[AramisResult]) -> Figures:
    """Percentages, and the largest errors of the right ones in degrees."""
    right = [result for result in results if result.right]
    smeared = [result.reason == "smear" for result in results]
    return {
        "right": rate(r.right for r in results),
        "smear": rate(smeared),
        "other": rate(not r.right and not smear for r, smear in zip(results, smeared, strict=True)),
        "cross_worst": max((r.error_cross_deg or 0.0 for r in right), default=np.nan),
        "roll_worst": max((abs(r.error_roll_deg or 0.0) for r in right), default=np.nan),
    }


def _upset(results: Sequence[AramisResult]) -> Figures:
    """Flipped bits, what loading corrected and lost, and the percentage of right results."""
    counts = {
        name: sum(getattr(r, name) for r in results) for name in ("flips", "corrected", "lost")
    }
    return {**counts, "right": rate(r.right for r in results)}


#: Steps of a measurement by the figure that they belong to.
STEPS = {
    "capture": ("capture",),
    "check": ("check",),
    "threshold": ("threshold",),
    "spikes": ("spikes",),
    "centroids": ("centroids",),
    "search": ("faces", "triangles", "search", "pivoting", "identities"),
    "attitude": ("attitude",),
    "verification": ("verification",),
}


def _times(opened: AramisOpener, frames: int) -> Figures:
    """Mean times in ms with each library's costs."""
    figures: dict[str, float] = {}
    for library in LIBRARIES:
        board = {**opened.board, "set": f"library={library}"}
        results = list(measure("aramis", frames=frames, seed=1, **board))
        for name, steps in STEPS.items():
            times = [sum(result.phase_ms[step] for step in steps) for result in results]  # type: ignore[attr-defined]
            figures[f"{library}_{name}"] = float(np.mean(times))
        processing = [one for name, one in figures.items() if name.startswith(library)][1:]
        figures[f"{library}_processing"] = sum(processing)
    return figures


#: For figures in the text of pages.
_TEXT = {
    "moving": measured_in_turn(
        "aramis",
        _moving,
        {"roll": {"roll_rate": 10}, "turn": {"rate": 2}},
        60,
        extremes=("cross_worst", "roll_worst"),
        profile="extended",
    ),
    "flips": measured(
        "aramis",
        _upset,
        100,
        extremes=("flips", "corrected", "lost"),
        profile="extended",
        bit_flips=1e-6,
    ),
    "times": Trial(_times, 40, 2, 4),
    "fields": Trial(_fields, seconds=15, profiles=False),
    "stars alone": Trial(stars_alone, 1000, 20, 20, profiles=False),
    "skies": skies(
        "aramis",
        {"false5": {"false_stars": 5}, "false20": {"false_stars": 20, "false_mags": (0.0, 4.0)}},
    ),
}

FIDELITY = Fidelity(
    page="fidelity-aramis.md",
    trials={
        "lis": measured("aramis", _attitudes, 100, 3, 30),
        "aided": measured("aramis", _attitudes, 100, 3, 30, mode="assisted", hint_error=2),
        "catalogue": Trial(_catalogue, seconds=30, profiles=False),
        "lookups": Trial(_lookups, 300, 20, 5, profiles=False),
        "spikes": Trial(spikes, 30, 2, 5, profiles=False),
        "bounds": Trial(bounds, 300, 20, 5, profiles=False),
        "scores": _switched(_attitudes, 100, 3, 10, set="scores=variance"),
        **{f"ram-{one}": _in_ram(one) for one in ("checksum", "redundant", "coded")},
        **_TEXT,
    },
    tables=read_tables("cubestack.host.studies.aramis"),
)
