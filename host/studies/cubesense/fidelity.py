"""CubeSense's published figures (thesis, Stellenbosch University, 2011) and their trials."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from cubestack.emulator.boards.cubesense.board import CUBESENSE_POWER
from cubestack.emulator.camera.ov7620 import fisheye, lens_error, light
from cubestack.emulator.camera.ov7620.view import FisheyeCondition
from cubestack.emulator.scene.earth import EARTH_RADIUS_KM, angular_radius_deg
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.cameras.ov7620 import COLUMNS, EXPOSURE_LINES, ROWS
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.firmware_model.mcu.pic18 import LIBRARIES
from cubestack.hdl.cubesense.tops import AREA_FILE
from cubestack.hdl.flow.area_report import recorded_areas
from cubestack.host.experiments.cubesense.measure import CubeSenseOpener, SensorResult, view_of
from cubestack.host.experiments.measure import measure
from cubestack.host.experiments.opener import Opener
from cubestack.host.studies.cubesense import benches, calibrate, upsets
from cubestack.host.studies.cubesense.ball import EXPERIMENT, BallOptions
from cubestack.host.studies.cubesense.lens_fits import lens_fits
from cubestack.host.studies.cubesense.thresholds import thresholds
from cubestack.host.studies.fidelity.table import Fidelity, read_tables
from cubestack.host.studies.rows.estimate import average, deviation, rate_of
from cubestack.host.studies.rows.trial import Figures, Trial, measured, measured_in_turn
from cubestack.host.studies.upsets.figures import upset_figures

ALTITUDE_KM = 750.0  # of the text
SUN_BANDS = {
    "30": (0, 30),
    "40": (0, 40),
    "60": (40, 60),
    "90": (60, 90.1),
    "45": (0, 45),
    "rest": (45, 90.1),
}


def _sensor(results: Sequence[SensorResult]) -> Figures:
    """Errors along rows (alpha) and columns (beta), in all, and by angle to the boresight; times.

    ``sum`` is section 8's accuracy, mean absolute error plus sigma.
    """
    good = [result for result in results if result.detected and result.error_deg is not None]
    axes = np.array(
        [
            (r.alpha_deg - r.truth_alpha_deg, r.beta_deg - r.truth_beta_deg)  # type: ignore[operator]
            for r in good
        ]
    ).reshape(-1, 2)
    mean, sigma = np.abs(axes).mean(axis=0), axes.std(axis=0)
    error = np.array([result.error_deg for result in good])
    angle = np.array([np.hypot(r.truth_alpha_deg, r.truth_beta_deg) for r in good])  # type: ignore[arg-type]
    figures = {
        **dict(zip(("alpha", "beta"), mean, strict=True)),
        **dict(zip(("sigma_alpha", "sigma_beta"), sigma, strict=True)),
        **dict(zip(("sum_alpha", "sum_beta"), mean + sigma, strict=True)),
        "mean": error.mean(),
        "p95": np.percentile(error, 95),
        "worst": error.max(),
        "detected": rate_of(len(good), len(results)),
        "least_edges": min((r.edges or 0) for r in good),
        "most_edges": max((r.edges or 0) for r in good),
    }
    for name, (low, high) in SUN_BANDS.items():
        own = error[(angle >= low) & (angle < high)]
        figures[f"mean_{name}"] = own.mean() if own.size else np.nan
        figures[f"worst_{name}"] = own.max() if own.size else np.nan
    phases = {name: np.array([r.phase_ms[name] for r in good]) for name in good[0].phase_ms}
    figures |= {f"{name}_ms": values.mean() for name, values in phases.items()}
    inner = np.abs(axes[angle < 30])
    figures["sum_30"] = (inner.mean(axis=0) + axes[angle < 30].std(axis=0)).max()
    figures["sigma_ms"] = phases["total"].std()
    figures["imaging_ms"] = (phases["wait"] + phases["store"]).mean()
    detected = figures["detected"]
    return {name: float(value) for name, value in figures.items()} | {"detected": detected}


#: Switches that improve the nadir sensor, one by one.
SINGLE = {
    "sub-pixel": "edges=sub-pixel",
    "equidistant": "distortion=equidistant",
    "stereographic": "distortion=stereographic",
}

#: Readings of the processor's speed, by the prefix of their figures.
SPEEDS = {
    **{library: f"library={library}" for library in LIBRARIES},
    "oscillator": "clock=oscillator",
}


def _times(opened: CubeSenseOpener, frames: int, **options: Any) -> Figures:
    """Time of a measurement, and its sigma, at each of ``SPEEDS``."""
    figures: dict[str, float] = {}
    each = max(2, frames // len(SPEEDS))
    for name, speed in SPEEDS.items():
        board = {**opened.board, "set": ",".join(filter(None, (opened.board.get("set"), speed)))}
        found = _sensor(list(measure("cubesense", frames=each, seed=2, **board, **options)))  # type: ignore[arg-type]
        figures |= {f"{name}_{one}": found[one] for one in ("total_ms", "sigma_ms")}
    return figures


def _ball(opened: CubeSenseOpener, frames: int) -> Figures:
    """Mean offset in each direction and largest sigma, of ``frames`` images per angle."""
    step = 5.0 if frames > 1 else 30.0
    samples = max(2, frames)
    results = list(EXPERIMENT.run(opened, BallOptions(step=step, samples=samples)))
    figures = {result.direction: result.offset_deg or np.nan for result in results}
    largest = max(result.sigma_deg or 0.0 for result in results)
    return {**figures, "sigma": deviation(largest, samples - 1)}


def _scene(sensor: Camera, angle_deg: float) -> EarthSunScene:
    """Its target at an angle along the picture's rows."""
    return view_of(sensor, (angle_deg, 0.0), FisheyeCondition(), ALTITUDE_KM).scene


def _scatter(
    opened: CubeSenseOpener, frames: int, sensor: str, angles_deg: Sequence[float]
) -> Figures:
    """Standard deviation of pictures of the same pose, the largest of some angles and both axes."""
    largest, each = 0.0, max(2, frames // len(angles_deg))
    for angle in angles_deg:
        scene = _scene(Camera[sensor.upper()], angle)
        results = measure(
            "cubesense", frames=each, seed=2, sensor=sensor, scene=scene, **opened.board
        )
        found = np.array([(one.alpha_deg, one.beta_deg) for one in results])  # type: ignore[attr-defined]
        largest = max(largest, float(found.std(axis=0).max()))
    return {"sigma": deviation(largest, each - 1)}


def _power(_opened: CubeSenseOpener, _frames: int) -> Figures:
    """mW of the eight states of table 7.1."""
    power = PowerModel(Kernel(), CUBESENSE_POWER)
    for channel in CUBESENSE_POWER.channels:
        power.switch(channel, False)
    found = {}
    steps: tuple[tuple[str, Callable[..., None], str, str | bool], ...] = (
        ("reset", power.set_state, "processor", "reset"),
        ("standby", power.set_state, "processor", "on"),
        ("memory", power.switch, "SRAM1", True),
        ("memories", power.switch, "SRAM2", True),
        ("camera", power.switch, "sun_camera", True),
        ("cameras", power.switch, "nadir_camera", True),
        ("", power.set_state, "sun_fpga", "imaging"),
        ("imaging1", power.set_state, "sram1", "active"),
        ("", power.set_state, "nadir_fpga", "imaging"),
        ("imaging2", power.set_state, "sram2", "active"),
    )
    for name, change, part, state in steps:
        change(part, state)
        if name:
            found[name] = power.current_ma() * CUBESENSE_POWER.volts
    return found


def _lens(_opened: CubeSenseOpener, _frames: int) -> Figures:
    """Figures that follow from the measured polynomial, the Earth's size and the pixels."""
    a, b, c, d = fisheye.DISTORTION
    field_px = lens_error.FIELD_DEG * fisheye.PIXELS_PER_DEGREE
    rim_px = float(fisheye.distort(field_px))
    earth_deg = angular_radius_deg(ALTITUDE_KM)
    earth_px = float(fisheye.distort(earth_deg * fisheye.PIXELS_PER_DEGREE))
    # Two points 10 cm apart on a board at 103 cm, near the boresight (section 5.1.3).
    board_px = float(fisheye.distort(np.degrees(np.arctan(10 / 103)) * fisheye.PIXELS_PER_DEGREE))
    ball_mm = 10 * 30 * ALTITUDE_KM / EARTH_RADIUS_KM
    slant_mm = np.sqrt(1 + ball_mm**2 - 2 * ball_mm * np.cos(np.radians(30)))
    return {
        "discriminant": 18 * a * b * c * d
        - 4 * b**3 * d
        + (b * c) ** 2
        - 4 * a * c**3
        - 27 * (a * d) ** 2,
        "deg_per_px": lens_error.FIELD_DEG / rim_px,
        "field_px": field_px,
        "rim_px": rim_px,
        "focal_mm": board_px * 0.0076 * 103 / 10,
        "earth_deg": earth_deg,
        "earth_px": earth_px,
        "sampling": 8 * earth_px / 16,
        "edges_64": 8 * earth_px / 64,
        "ball_px": float(fisheye.distort(182.0)),
        "ball_cm": ball_mm / 10,
        "span_angle": 100 * earth_deg / lens_error.FIELD_DEG,
        "span_px": 100 * 182 / field_px,
        "off_deg": float(np.degrees(np.arcsin(np.sin(np.radians(30)) / slant_mm))),
        "off_km": ALTITUDE_KM / slant_mm,
    }


def _tiles(opened: CubeSenseOpener, _frames: int) -> Figures:
    """Stored estimates of tiles: FPGAs with both searches and with one, and counters."""
    designs = recorded_areas(AREA_FILE)
    flown = "-both-searches" * (opened.board["profile"] == "published")
    names = {
        **{side: f"cubesense-{side}{flown}" for side in ("sun", "nadir")},
        **{f"{side}_one": f"cubesense-{side}-one-search" for side in ("sun", "nadir")},
        "matrix": "matrix counter 640 x 480",
        "gray": "Gray counter of 307200",
    }
    return {name: float(designs[design]["tiles"]) for name, design in names.items()}


def _light(_opened: CubeSenseOpener, _frames: int) -> Figures:
    """Grey value of the Earth at noon, its threshold, and the Sun's radius in px."""
    bloom_px, space = FisheyeCondition().bloom_px, 34
    lines = light.USUAL_EXPOSURE[CameraTarget.NADIR] * EXPOSURE_LINES
    grey = lines * light.scene_light(_scene(Camera.NADIR, 0.0), CameraTarget.NADIR, bloom_px, 0)
    level = float(grey[grey > grey.max() / 3].mean()) + space
    figures = {"earth": level, "threshold": space + 0.3 * (level - space)}
    lines = light.USUAL_EXPOSURE[CameraTarget.SUN] * EXPOSURE_LINES
    for name, angle in (("centre", 0.0), ("edge", 90.0)):
        spot = lines * light.scene_light(_scene(Camera.SUN, angle), CameraTarget.SUN, bloom_px, 0)
        figures[f"sun_{name}"] = float(np.sqrt((spot > light.SUN_EDGE).sum() / np.pi))
    return figures


def _memory(_opened: CubeSenseOpener, _frames: int) -> Figures:
    """Share of the memory that images leave free, and share beyond their last address."""
    size = 1 << 19
    stride = 1 << (COLUMNS - 1).bit_length()
    beyond = ROWS * stride + COLUMNS
    return {
        "free": 100 * (1 - ROWS * COLUMNS / size),
        "contiguous": 100 * (1 - beyond / size),
        "beyond": beyond,
    }


def _search(results: Sequence[SensorResult]) -> Figures:
    """Pixels that the processor read, times in ms, and the 95th percentile of the error in deg."""
    errors = [one.error_deg for one in results if one.error_deg is not None]
    return {
        "pixels": average(one.pixels_read for one in results),
        "search_ms": average(one.phase_ms["search"] for one in results),
        "total_ms": average(one.phase_ms["total"] for one in results),
        "mean": average(errors),
        "p95": float(np.percentile(errors, 95)),
        "found": rate_of(len(errors), len(results)),
    }


def _read_out(opened: CubeSenseOpener, frames: int) -> Figures:
    """Mean times in ms to read the Sun's window and to scan the Earth's image, by gateware, sensor
    and memory; without the scan that is longer than the processor's timer."""
    figures: dict[str, float] = {}
    for gateware in upsets.VARIANTS:
        board = {**opened.board, "set": f"gateware={gateware}"}
        for sensor, memory in product(("sun", "nadir"), ("own", "other")):
            if (gateware, sensor, memory) == ("one-search", "nadir", "other"):
                continue
            where = {"sensor": sensor, "memory": memory}
            results = measure("cubesense", frames=frames, seed=2, **where, **board)  # type: ignore[arg-type]
            times = [one.phase_ms["search"] for one in results]  # type: ignore[attr-defined]
            figures[f"{gateware} {sensor} {memory}"] = float(np.mean(times))
    return figures


def _calibrated(opened: CubeSenseOpener, frames: int) -> Figures:
    """Mean errors in deg before and after a calibration, by unit and sensor."""
    with_lens = Opener(opened.device, board={**opened.board, "set": "lens=residuals"})
    figures: dict[str, float] = {}
    for unit in (0, 1):
        how = calibrate.CalibrateOptions(seed=unit, emulated=frames, check_poses=frames // 2)
        for one in calibrate.EXPERIMENT.run(with_lens, how):
            figures[f"{unit} {one.sensor} before"] = one.error_before_deg or np.nan
            figures[f"{unit} {one.sensor} after"] = one.error_after_deg or np.nan
    return figures


_measured = partial(
    measured, "cubesense", _sensor, seed=2, units=10, extremes=("worst", "least", "most")
)

_in_turn = partial(measured_in_turn, "cubesense", seed=2)
_NADIR = {"sensor": "nadir"}

#: For figures in the text of pages.
_TEXT: dict[str, Trial] = {
    "nominal": _in_turn(
        _sensor,
        {sensor: {"sensor": sensor, "set": "lens=nominal"} for sensor in ("nadir", "sun")}
        | {name: {**_NADIR, "set": f"lens=nominal,{switch}"} for name, switch in SINGLE.items()},
        100,
        10,
        25,
        units=10,
        extremes=("worst", "least", "most"),
        profile="published",
    ),
    "altitudes": _in_turn(
        _sensor,
        {f"{altitude}": {**_NADIR, "altitude": altitude} for altitude in (400, 750, 1500)},
        50,
        extremes=("worst", "least", "most"),
        profile="extended",
    ),
    "search": _in_turn(
        _search,
        {name: {**_NADIR, "search": name} for name in ("lines", "samples", "stepping")},
        60,
        profile="extended",
    ),
    "other": _in_turn(
        _search,
        {sensor: {"sensor": sensor, "memory": "other"} for sensor in ("nadir", "sun")}
        | {"bloom": {"sensor": "sun", "bloom": 8}},
        50,
        profile="extended",
    ),
    "upsets": Trial(partial(upset_figures, experiment=upsets.EXPERIMENT), 1, 0, 90, profiles=False),
    "read-out": Trial(_read_out, 2, 1, 5, profile="published"),
    "calibrated": Trial(_calibrated, 60, 8, 24),
}

FIDELITY = Fidelity(
    page="fidelity-cubesense.md",
    trials={
        "ball": Trial(_ball, 10, 1, 30, "ball"),
        "nadir": _measured(300, 4, 40, sensor="nadir"),
        "sun": _measured(300, 6, 25, sensor="sun"),
        "nadir-time": Trial(partial(_times, sensor="nadir"), 90, 6, 15),
        "sun-time": Trial(partial(_times, sensor="sun", sun_angle=5), 90, 6, 10),
        "sun-still": Trial(partial(_scatter, sensor="sun", angles_deg=(0.0, 40.0, 80.0)), 60, 6, 8),
        "partial": Trial(benches.partial_earth, 5, 2, 8),
        "scatter": Trial(benches.scatter, 8, 2, 18),
        "power": Trial(_power, profiles=False),
        "lens": Trial(_lens, profiles=False),
        "threshold": Trial(thresholds, 6, 2, 12),
        "lens-fits": Trial(lens_fits),
        "light": Trial(_light, profiles=False),
        "tiles": Trial(_tiles, command="hdl area"),
        "memory": Trial(_memory, profiles=False),
        **_TEXT,
    },
    tables=read_tables("cubestack.host.studies.cubesense"),
)
