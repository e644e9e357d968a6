"""Starlight on the sensor: the electrons of each star while the camera turns.

CubeStar thesis, section 4.1.1 (defocused stars as a two-dimensional Gaussian, eq. 4.1.7) and
appendix C (rolling shutter).

Motion is a sum over instants of the exposure, closer together than one sigma of the spot. Each star
is placed at the instants of its own row, so a rolling shutter shifts, bends and stretches its
streak. Within one spot all rows share those instants: this neglects a shear of the spot by the
motion in one line time, a hundredth of a pixel per row at 4 deg/s.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.camera.common.glow import glow_electrons
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.light.spots import reach_px, spots
from cubestack.emulator.scene.attitude import matrix_from_quaternion
from cubestack.emulator.scene.hazards.contract import CameraState, Vectors
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S

FAINTEST_V = 8.0
"""Magnitude limit: at the longest exposure, fainter stars peak below one count of 8 bits."""

VELOCITY_STEP_S = 0.01
MOST_GLOWS = 8  # limit of the instants of an exposure at which a glow is evaluated


def star_light(scene: SkyScene, optics: Optics, shutter: RollingShutter) -> NDArray[np.float32]:
    """Mean number of electrons from starlight in each pixel, shape (rows, columns)."""
    vectors, rates = _stars(scene, optics, shutter)
    phases = _phases(scene, optics, shutter)
    pixels, light = [], []
    for phase in phases:
        places, weights = _instant(scene, optics, shutter, vectors, phase)
        pixels.append(places)
        light.append(rates * weights / len(phases))
    for places, rates in _hazard_lights(scene, optics, shutter):
        pixels.append(places)
        light.append(rates)
    if scene.false_stars:
        places, magnitudes = scene.false_lights()
        pixels.append(places * [optics.columns - 1, optics.rows - 1])
        light.append(optics.electrons_per_second(magnitudes))
    electrons = np.concatenate(light) * shutter.exposure_s
    shape = optics.rows, optics.columns
    image = spots(np.concatenate(pixels), electrons, optics.psf_sigma_px, shape)
    if scene.atmosphere is not None and scene.atmosphere.sky_mag is not None:
        glow = optics.electrons_per_second(scene.atmosphere.sky_mag) * optics.pixel_arcsec2
        image += np.float32(glow * shutter.exposure_s) * optics.even_light
    if scene.hazards:
        count = min(len(phases), MOST_GLOWS)
        instants = [camera_state(scene, optics, shutter, (i + 0.5) / count) for i in range(count)]
        electrons_per_s = glow_electrons(scene.hazards, instants, optics)
        if electrons_per_s is not None:
            image += electrons_per_s * np.float32(shutter.exposure_s)
    return image


def camera_state(
    scene: SkyScene, optics: Optics, shutter: RollingShutter, phase: float = 0.5
) -> CameraState:
    """The camera's state for hazards at the instant ``phase`` of the middle row's exposure."""
    now = _time_ps(optics, shutter, phase)
    return camera_state_for(
        scene.truth(now), optics, time_s=now / PS_PER_S, exposure_s=shutter.exposure_s
    )


def camera_state_for(
    quaternion: ArrayLike, optics: Optics, time_s: float = 0.0, exposure_s: float = 0.0
) -> CameraState:
    """The state for hazards of a camera with attitude ``quaternion`` (4,)."""
    x, y = optics.columns - 0.5, optics.rows - 0.5
    middle_x, middle_y = (x - 0.5) / 2, (y - 0.5) / 2
    edges = np.array([[-0.5, middle_y], [x, middle_y], [middle_x, -0.5], [middle_x, y]])
    left, right, top, bottom = optics.unproject(edges)
    return CameraState(
        axes=matrix_from_quaternion(quaternion),
        width_deg=math.degrees(math.acos(left @ right)),
        height_deg=math.degrees(math.acos(top @ bottom)),
        half_field_deg=min(optics.half_field_deg, optics.field_stop_deg / 2),
        pixel_rad=math.sqrt(optics.pixel_arcsec2) * math.pi / 648_000,
        time_s=time_s,
        exposure_s=exposure_s,
    )


def star_pixels(
    scene: SkyScene, optics: Optics, shutter: RollingShutter
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Hipparcos numbers (n,) and pixels (n, 2) of the stars on the sensor, at mid-exposure.

    For tests and drawings.
    """
    sky = load_sky(scene.epoch, _limit(scene))
    vectors, covered = _apparent_lights(scene, camera_state(scene, optics, shutter), sky.vectors)
    pixels, _ = _instant(scene, optics, shutter, vectors, 0.5)
    columns, rows = optics.columns, optics.rows
    x, y = pixels.T
    on = (np.abs(x - (columns - 1) / 2) <= columns / 2) & (np.abs(y - (rows - 1) / 2) <= rows / 2)
    on &= ~covered
    return sky.hip[on], pixels[on]


def _limit(scene: SkyScene) -> float:
    return FAINTEST_V if scene.mag_limit is None else scene.mag_limit


def _stars(
    scene: SkyScene, optics: Optics, shutter: RollingShutter
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors (n, 3) and electrons per second (n,) of the stars that may come into view."""
    sky = load_sky(scene.epoch, _limit(scene))
    seconds = shutter.exposure_s + optics.rows * shutter.line_s
    reach = optics.half_field_deg + scene.speed_deg_s * seconds / 2 + 1
    middle = _time_ps(optics, shutter, 0.5)
    boresight = matrix_from_quaternion(scene.truth(middle))[2]
    near = sky.around(boresight, reach)
    vectors, rates = sky.vectors[near], optics.electrons_per_second(sky.v_mag[near])
    if scene.hazards:
        vectors, covered = _apparent_lights(scene, camera_state(scene, optics, shutter), vectors)
        vectors, rates = vectors[~covered], rates[~covered]
    if scene.atmosphere is None:
        return vectors, rates
    # Seeded by the frame time, like the sensor's noise.
    generator = np.random.default_rng([scene.seed, 0xA12, max(0, shutter.readout_ps)])
    vectors, share = scene.atmosphere.apparent(
        vectors, middle / PS_PER_S, shutter.exposure_s, optics.aperture_mm, generator
    )
    return vectors, rates * share


def _apparent_lights(
    scene: SkyScene, now: CameraState, vectors: Vectors, depth: int = -1
) -> tuple[Vectors, NDArray[np.bool_]]:
    """Apparent directions (n, 3) of light from ``vectors``, and which (n,) hazards hide.

    Only hazards nearer than ``depth`` hide light.
    """
    covered = np.zeros(len(vectors), bool)
    for hazard in scene.hazards:
        hidden = hazard.hidden(now, vectors) if hazard.depth > depth else None
        if hidden is not None:
            covered |= hidden
    for hazard in scene.hazards:
        vectors = hazard.apparent(now, vectors)
    return vectors, covered


def _hazard_lights(
    scene: SkyScene, optics: Optics, shutter: RollingShutter
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Pixels (n, 2) of the hazards' points of light, and their electrons (n,) per second."""
    for hazard in scene.hazards:
        phases = _phases(scene, optics, shutter, hazard.speed_deg_s)
        for phase in phases:
            now = camera_state(scene, optics, shutter, phase)
            lights = hazard.lights(now)
            if lights is None:
                break
            vectors, covered = _apparent_lights(scene, now, lights.vectors, hazard.depth)
            places, weights = _instant(scene, optics, shutter, vectors[~covered], phase)
            rates = optics.electrons_per_second(lights.v_mag[~covered])
            yield places, rates * weights / len(phases)


def _phases(
    scene: SkyScene, optics: Optics, shutter: RollingShutter, own_deg_s: float = 0.0
) -> NDArray[np.float64]:
    """Instants to sum over, as fractions of the exposure; ``own_deg_s``: speed of the light."""
    # The image scale is largest at the corners, by about a fifth.
    px_per_deg = 1.25 * optics.fx * math.pi / 180
    travel_px = (scene.speed_deg_s + own_deg_s) * shutter.exposure_s * px_per_deg
    samples = max(1, math.ceil(travel_px / optics.psf_sigma_px))
    return (np.arange(samples) + 0.5) / samples


def _time_ps(optics: Optics, shutter: RollingShutter, phase: float) -> int:
    exposure_ps = shutter.exposure_lines * shutter.line_ps
    middle_row = (optics.rows - 1) / 2
    return shutter.mid_exposure_ps(middle_row) + round((phase - 0.5) * exposure_ps)


def _instant(
    scene: SkyScene,
    optics: Optics,
    shutter: RollingShutter,
    vectors: NDArray[np.float64],
    phase: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pixels (n, 2) of stars at the instant ``phase`` of their own rows, and weights (n,).

    A star that moves down with the read-out is exposed by more rows, each for the full time. Stars
    that do not move become NaN where their spots are beyond the sensor.
    """
    now = _time_ps(optics, shutter, phase)
    in_camera = vectors @ matrix_from_quaternion(scene.truth(now)).T
    if not scene.speed_deg_s:
        near = optics.may_meet(in_camera, reach_px(optics.psf_sigma_px))
        pixels, weights = np.full((len(vectors), 2), np.nan), np.zeros(len(vectors))
        pixels[near] = optics.project(in_camera[near])
        weights[near] = optics.transmission(in_camera[near])
        return pixels, weights
    pixels, weights = optics.project(in_camera), optics.transmission(in_camera)
    # The present pose, even if the next one begins in between, for its velocity.
    later = scene.pose_at(now).at(now / PS_PER_S + VELOCITY_STEP_S)
    moved = optics.project(vectors @ matrix_from_quaternion(later).T)
    per_line = (moved - pixels) * (shutter.line_s / VELOCITY_STEP_S)
    # y + vy * (row - middle) = row, solved for the row, counted from the middle one.
    stretch = 1 / (1 - per_line[:, 1])
    lines = (pixels[:, 1] - (optics.rows - 1) / 2) * stretch
    return pixels + per_line * lines[:, None], weights * stretch
