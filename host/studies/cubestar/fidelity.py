"""CubeStar's published figures (thesis, Stellenbosch University, 2013) and their trials."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from cubestack.emulator.boards.cubestar.board import BOOT_US
from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.emulator.boards.cubestar.layouts import CUBESTAR_POWER
from cubestack.emulator.scene.attitude import random_quaternion
from cubestack.emulator.scene.hipparcos import CATALOGUE_EPOCH, load_sky
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, PIXEL_PITCH_MM, ROWS
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.host.experiments.attitude import AttitudeResult
from cubestack.host.experiments.cubestar.measure import CubeStarOpener
from cubestack.host.experiments.hazard_options import Asked
from cubestack.host.studies.calibrate import CalibrateOptions
from cubestack.host.studies.cubestar import upsets
from cubestack.host.studies.cubestar.bodies import BODIES
from cubestack.host.studies.cubestar.calibrate import EXPERIMENT
from cubestack.host.studies.cubestar.celestial import celestial
from cubestack.host.studies.cubestar.gyro import GYRO
from cubestack.host.studies.cubestar.layouts import (
    LayoutOptions,
    attitudes_of_loop,
    measure_layout,
    turns,
)
from cubestack.host.studies.cubestar.margins import margins
from cubestack.host.studies.cubestar.night import night
from cubestack.host.studies.cubestar.readings import READINGS, night_by, signs
from cubestack.host.studies.cubestar.shots import PICTURES, Shot, field_shots, slewing_shots
from cubestack.host.studies.cubestar.stars_alone import false_alarms, identification
from cubestack.host.studies.cubestar.variants import VARIANTS
from cubestack.host.studies.fidelity.table import Fidelity, read_tables
from cubestack.host.studies.hazards.overview import skies
from cubestack.host.studies.lens_errors import by_strength
from cubestack.host.studies.rows.estimate import average, rate, rate_of, resampled
from cubestack.host.studies.rows.trial import Figures, Trial, measured, measured_in_turn
from cubestack.host.studies.upsets.figures import upset_figures

RATES = (0.0635, 0.1333, 0.3, 2.0, 8.0)
"""Of section 6.2, in deg/s."""
AS_PRINTED = "equation=printed,estimate=votes"
CRYSTAL_HZ = 10_000_000
REGISTERS = (30, 9, 8, 7, 6)
"""Settings of table D.2."""

COVERAGE_DEG = 42.33  # diameter; the caption of table 3.6 calls it a radius
STARS_DRAWN = 18


def _field(opened: CubeStarOpener, frames: int, **how: Any) -> Figures:
    taken = list(field_shots(opened, frames, **how))
    return {
        "three": rate(shot.matched - shot.wrong > 2 for shot in taken),
        "right": rate(shot.right for shot in taken),
        "star_wrong": rate(shot.wrong > 0 for shot in taken),
        "off": rate(shot.valid and not shot.right for shot in taken),
        "share": average(
            100 * (shot.matched - shot.wrong) / max(shot.detected, 1) for shot in taken
        ),
    }


def _slew(opened: CubeStarOpener, frames: int, rate_deg_s: float) -> Figures:
    """Rates in percent of images 1 s apart, and the median error in degrees."""
    shots = [shot for shot, _ in slewing_shots(opened, frames, rate_deg_s)]
    skies = [shots[at : at + PICTURES] for at in range(0, len(shots), PICTURES)]
    return {
        "right": rate(shot.right for shot in shots),
        "tracked": rate(one.tracked for at, one in enumerate(shots) if at % PICTURES),
        "off": rate(shot.valid and not shot.right for shot in shots),
        **resampled(_matched, skies),
    }


def _matched(shots: Sequence[Shot]) -> Figures:
    cross = [shot.cross_deg for shot in shots if shot.right]
    return {
        "share": 100 * sum(s.matched for s in shots) / max(1, sum(s.detected for s in shots)),
        "cross": float(np.median(cross)) if cross else np.nan,
    }


def _attitudes(results: Sequence[AttitudeResult]) -> Figures:
    """Rates in percent, errors of the right ones in degrees, times in ms."""
    right = [result for result in results if result.right]
    cross = [result.error_cross_deg or 0.0 for result in right] or [np.nan]
    roll = [abs(result.error_roll_deg or 0.0) for result in right] or [np.nan]
    full = [result.phase_ms for result in results if result.centroids >= 20]
    both = [phases["detect"] + phases["match"] for phases in full] or [np.nan]
    return {
        "right": rate(result.right for result in results),
        "off": rate(result.solved and not result.right for result in results),
        "cross_worst": max(cross),
        "roll_worst": max(roll),
        "cross95": float(np.percentile(cross, 95)),
        "roll95": float(np.percentile(roll, 95)),
        "algorithms_ms": max(both),
        "match_ms": max((phases["match"] for phases in full), default=np.nan),
        "quest_ms": max((phases["attitude"] for phases in full), default=np.nan),
    }


def _catalogue(_opened: CubeStarOpener, _frames: int) -> Figures:
    flown, wider, text = (
        onboard_catalogue(pair_limit_deg=limit) for limit in (42.101, 42.105, 60.0)
    )
    closest = flown.pairs.angle
    listed = onboard_catalogue(epoch=CATALOGUE_EPOCH).vectors.astype(float)
    return {
        "stars": len(flown),
        "star_kb": flown.star_bytes / 1024,
        "pairs": len(flown.pairs),
        "wider": len(wider.pairs),
        "text": len(text.pairs),
        "pair_kb": flown.pair_bytes / 1024,
        "first": float(closest[0]),
        "second": float(closest[1]),
        "between_31_401": float(np.arccos(listed[30] @ listed[400])),
        "between_32_92": float(np.arccos(listed[31] @ listed[91])),
    }


def _coverage(_opened: CubeStarOpener, frames: int) -> Figures:
    """Fields with three stars and five, and their mean number, by the faintest magnitude."""
    rng = np.random.default_rng(1)
    boresights = rng.standard_normal((frames, 3))
    boresights /= np.linalg.norm(boresights, axis=1, keepdims=True)
    figures = dict[str, float]()
    for limit in (3.0, 3.2, 3.4, 3.5, 3.6, 3.8, 4.0, 5.0):
        vectors = load_sky(CATALOGUE_EPOCH, limit).vectors.astype(np.float32)
        cosines = boresights.astype(np.float32) @ vectors.T
        diameter = {3.5: 50.0, 5.0: 20.0}.get(limit, COVERAGE_DEG)  # figure 3.8's two examples
        seen = np.count_nonzero(cosines > np.cos(np.radians(diameter / 2)), axis=1)
        name = f"{limit:.1f}".replace(".", "_")
        figures[f"three_{name}"] = rate_of(int(np.count_nonzero(seen >= 3)), frames)
        figures[f"five_{name}"] = rate_of(int(np.count_nonzero(seen >= 5)), frames)
        figures[f"mean_{name}"] = average(seen)
    return figures


def _centroids(opened: CubeStarOpener, frames: int) -> Figures:
    """Mean errors in px of stars drawn into uploaded pictures, 5 x 5 Gaussians of sigma 1 px."""
    rng, errors = np.random.default_rng(1), []
    with opened(None, seed=0) as emulated:
        for _ in range(frames):
            cells = rng.permutation(10 * 5)[:STARS_DRAWN]  # one star a cell keeps them apart
            grid = np.stack([cells % 10 * 100 + 50, cells // 10 * 100 + 50], axis=1)
            centres = grid + rng.uniform(-20, 20, grid.shape)
            picture = np.zeros((512, 1024), np.uint8)
            for x, y in centres:
                rows, columns = np.mgrid[round(y) - 2 : round(y) + 3, round(x) - 2 : round(x) + 3]
                squared = (columns - x) ** 2 + (rows - y) ** 2
                picture[rows, columns] = np.round(255 * np.exp(-squared / 2))
            emulated.client.upload_image(picture)
            emulated.client.process_image()
            found = np.array([(star.x_px, star.y_px) for star in emulated.client.stars()])
            nearest = np.linalg.norm(found[:, None] - centres, axis=2).argmin(axis=1)
            errors.append(np.abs(found - centres[nearest]).mean(axis=0))
    return dict(zip("xy", map(average, np.array(errors).T), strict=True))


def _loop(opened: CubeStarOpener, frames: int) -> Figures:
    """Phases of the 1 Hz loop's last turn in ms, its power in mW over ``frames``, ages in ms."""
    with opened(None, seed=0) as device:
        device.client.client.command("Trigger")
        begun, *found = attitudes_of_loop(device.board, frames)
        device.client.client.command("StopLoop")
        phases, volts = device.client.phase_times(), device.board.power.table.volts
    took_s = (found[-1].time_ps - begun.time_ps) / 1e12
    mw = (found[-1].charge_mas - begun.charge_mas) * volts / took_s
    age_ms = math.fsum(one.age_ms for one in found) / len(found)
    return {**phases, "mw": mw, "age": age_ms, "oldest": age_ms + 1000 * took_s / len(found)}


def _spots(opened: CubeStarOpener, frames: int) -> Figures:
    """Pixels that stars of the list cover in pictures: 5th, 50th and 95th percentile."""
    rng, pixels = np.random.default_rng(1), list[list[int]]()
    with opened(None, seed=1) as device:
        for seed in range(frames):
            device.scene = SkyScene(quaternion=random_quaternion(rng), mag_limit=3.8, seed=seed)
            device.client.capture_and_process()
            pixels.append([star.pixels for star in device.client.stars()])
    return resampled(_percentiles, pixels)


def _percentiles(pixels: Sequence[int]) -> Figures:
    return dict(zip(("low", "middle", "high"), np.percentile(pixels, (5, 50, 95)), strict=True))


def _calibration(opened: CubeStarOpener, frames: int) -> Figures:
    """What pictures of a drawn unit, and of its star pairs, say of the lens; it has 6.28 mm."""
    (result,) = EXPERIMENT.run(opened, CalibrateOptions(emulated=frames, seed=0))
    return {"residual": result.after_px, "pairs_mm": (result.pairs_f_px or np.nan) * PIXEL_PITCH_MM}


def _power(_opened: CubeStarOpener, _frames: int) -> Figures:
    """Currents in mA of the four modes of table 6.2."""
    power, found = PowerModel(Kernel(), CUBESTAR_POWER), {}
    modes = {
        "idle": {},
        "discard": {"imager": "enabled"},
        "capture": {"imager": "enabled", "fpga": "storing", "processor": "run"},
        "transfer": {"fpga": "reading", "processor": "run", "memory": "transfer"},
    }
    for name, states in modes.items():
        for part, model in CUBESTAR_POWER.parts.items():
            power.set_state(part, states.get(part, next(iter(model.ma))))
        found[name] = power.current_ma()
    leds = CUBESTAR_POWER.parts["leds"].ma["on"]
    return {
        **found,
        "peak_w": found["capture"] * CUBESTAR_POWER.volts / 1000,
        "leds_mw": leds * CUBESTAR_POWER.volts,
    }


def _rates(opened: CubeStarOpener, _frames: int) -> Figures:
    """Frames per second and exposure for each setting of the register, from successive captures."""
    figures = {}
    with opened(None, seed=0) as device:
        for register in REGISTERS:
            device.client.client.command("SetFrameRate", FrameRate=register)
            period_ms = 1000 * 27e6 / CRYSTAL_HZ / register
            times = []
            for delay_ms in (70, round(period_ms) + 5):
                device.client.client.command("SetDiscardDelay", Delay=delay_ms)
                device.client.capture()
                phases = device.client.phase_times()
                times.append(phases["discard"] + phases["capture"])
            figures[f"fps_{register}"] = 1000 / (times[1] - times[0])
            stored = device.board.stored[-1]
            assert stored is not None
            figures[f"exposed_{register}"] = 1000 * stored.exposure_s
    return figures


def _optics(_opened: CubeStarOpener, _frames: int) -> Figures:
    """Fields of view by equations 3.5.2 to 3.5.4, and what follows from the sensor's data."""

    def angle(size_px: int, focal_mm: float) -> float:
        return float(np.degrees(2 * np.arctan(size_px * PIXEL_PITCH_MM / 2 / focal_mm)))

    # Equation 3.4.2: lens of 1 cm radius, 0.6 let through, 3000 Angstrom.
    brightest = np.pi * 0.6 * 3000 * 1000
    photons = 25e-9 * 535e-9 / (6.63e-34 * 3e8) * (PIXEL_PITCH_MM / 10) ** 2
    return {
        "wide": angle(COLUMNS, 6.0),
        "high": angle(ROWS, 6.0),
        "round": 2 * float(np.sqrt(angle(COLUMNS, 6.0) * angle(ROWS, 6.0) / np.pi)),
        "wide_fitted": angle(COLUMNS, 6.28),
        "high_fitted": angle(ROWS, 6.28),
        "photons": photons,
        "saturated_s": (1 << 12) / 1008,
        "faintest": float(2.5 * np.log10(brightest / photons)),
        "faintest_spread": float(2.5 * np.log10(brightest / 9 / photons)),
        "expected_ms": 2 * 3.3e9 / 48e6,
        "boot_ms": BOOT_US / 1000,
        "least_fps": 11e6 / 5_413_590,
    }


def _layout(opened: CubeStarOpener, frames: int, layout: str) -> Figures:
    """Of a memory layout in its loop over as many seconds; nan for what has no attitudes."""
    found = measure_layout(Layout(layout), opened, LayoutOptions(seconds=frames))
    names = ("rate_hz", "age_ms", "oldest_ms", "power_mw", "energy_mj")
    return {
        **{name: getattr(found, name) or np.nan for name in names},
        "copy_ms": found.phase_ms["transfer"],
        "pins": found.pins,
        "tiles": found.tiles,
        "fpgas": found.fpgas,
        "right": rate_of(found.right or 0, found.attitudes),
    }


def _skies() -> dict[str, Trial]:
    """Tables 4.4 and 4.5: skies and modes."""
    skies: dict[str, dict[str, Any]] = {f"v{v}": {"mag_limit": v} for v in (3.6, 3.7, 3.8)}
    skies |= {f"false{n}": {"mag_limit": 3.8, "false_stars": n} for n in (1, 5, 10)}
    modes = {"lis": None, "assisted": 5.0, "exact": 0.0}
    return {
        f"{sky}-{mode}": Trial(partial(_field, hint_deg=hint, **how), 100, 1, 8)
        for sky, how in skies.items()
        for mode, hint in modes.items()
        if mode != "exact" or "false_stars" not in how
    }


_measured = partial(
    measured,
    "cubestar",
    _attitudes,
    extremes=("cross_worst", "roll_worst", "algorithms", "match", "quest"),
)

_ASSISTED = {"mode": "assisted", "hint_error": 5}
_FALSE = {f"false{count}": {"mag_limit": 3.8, "false_stars": count} for count in (5, 20)}
_FOCAL = {
    f"focal-length={percent}": {"hazard": (Asked("focal-length", percent),)}
    for percent in (0.5, 1, 3)
}

_LENSES = {"lens-residuals": (0.2, 0.5, 1.0), "focal-length": (0.5, 1.0, 3.0)}

#: For figures in the text of pages.
_TEXT = {
    "limits": measured_in_turn(
        "cubestar",
        _attitudes,
        {
            "bright": {"mag_limit": 3.8},
            "bright, assisted": {"mag_limit": 3.8, **_ASSISTED},
            "all": {},
            "all, assisted": {"threshold": 16, **_ASSISTED},
            "threshold 6": {"threshold": 6},
            "threshold 6, assisted": {"threshold": 6, **_ASSISTED},
        },
        100,
        seconds=30,
    ),
    "turns": Trial(turns, 10, 3, 2),
    "identification": Trial(identification, 2000, 20, 20, profiles=False),
    "false alarms": Trial(false_alarms, 3000, 60, 12, profiles=False),
    **{
        name: Trial(
            partial(by_strength, device="cubestar", hazard=name, strengths=strengths),
            120,
            2,
            15,
            profiles=False,
        )
        for name, strengths in _LENSES.items()
    },
    "margins": Trial(margins, 200, 5, 20, profiles=False),
    "upsets": Trial(partial(upset_figures, experiment=upsets.EXPERIMENT), 8, 0, 90, profiles=False),
    "skies": skies("cubestar", {"bright": {"mag_limit": 3.8}, **_FALSE, **_FOCAL}),
}

FIDELITY = Fidelity(
    page="fidelity.md",
    trials={
        **_skies(),
        **{f"slew-{speed}": Trial(partial(_slew, rate_deg_s=speed), 50, 2, 5) for speed in RATES},
        "catalogue": Trial(_catalogue, seconds=2, profiles=False),
        "coverage": Trial(_coverage, 20_000, 500, 10, profiles=False),
        "centroids": Trial(_centroids, 10, 1, 15),
        "noiseless": _measured(100, mag_limit=3.8, no_noise=True),
        "built": _measured(100, mag_limit=3.8),
        "full": _measured(60, mag_limit=4.5),
        "night": Trial(night, 30, 1, 20),
        **{f"reading-{name}": Trial(partial(night_by, reading=name), 8, 1, 8) for name in READINGS},
        "signs": Trial(signs, profiles=False),
        "celestial": Trial(celestial, 20, 1, 12),
        "noiseless-as-printed": _measured(100, mag_limit=3.8, no_noise=True, set=AS_PRINTED),
        "full-as-printed": _measured(60, mag_limit=4.5, set=AS_PRINTED),
        **VARIANTS,
        **GYRO,
        **BODIES,
        "loop": Trial(_loop, 20, 2, 10),
        **{
            f"layout-{layout.value}": Trial(partial(_layout, layout=layout.value), 30, 2, 5)
            for layout in Layout
        },
        "calibration": Trial(
            _calibration, 20, 6, 5, "calibrate cubestar --emulated 20 --seed 0", profiles=False
        ),
        "power": Trial(_power, profiles=False),
        "spots": Trial(_spots, 20, 1, 3),
        "rates": Trial(_rates, seconds=2, profiles=False),
        "optics": Trial(_optics, profiles=False),
        **_TEXT,
    },
    tables=read_tables("cubestack.host.studies.cubestar"),
    elsewhere={"memory layouts": "layouts.md"},
)
