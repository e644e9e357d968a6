"""Light of a scene through CubeSense's fisheye lenses: Earth, Sun and all hazards on the pixels.

CubeSense thesis, section 3.1.2.2 (the ND 4 filter of the Sun camera), section 5.1.3.2 (the Sun's
image is 8 px in radius on the boresight and 6 px near the rim, for its 0.27 deg), section 5.1.4
(Sun exposure) and section 5.7 (levels). Unit: grey values above black per line time of exposure at
gain 1.

The thesis explains the Sun's size by charge that overflows from full pixels into their neighbours.
Here its image is a round Gaussian spot of the published size, wider than the Sun and saturated in
the middle. In the nadir camera, without a filter, the spot is far brighter.

The brightness of hazards is relative to the Earth, whose radiance 1 is 4.75e9 stars of V = 0 per
steradian. On this scale the Sun's spot, with the published size, has a hundred times its true
light. Hazards without a direction of the Sun use the scene's.

An image is computed for one instant: this neglects the satellite's rotation during a read-out.
"""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.camera.common.glow import brightness
from cubestack.emulator.camera.ov7620.fisheye import Fisheye, lens_of
from cubestack.emulator.camera.ov7620.lens_error import FIELD_DEG, NOMINAL, LensError
from cubestack.emulator.camera.ov7620.luminance import SPOT_PX
from cubestack.emulator.scene.attitude import vector_from_angles
from cubestack.emulator.scene.earth import angular_radius_deg
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene
from cubestack.emulator.scene.hazards import contract as sky
from cubestack.emulator.scene.hazards.ghosts import Ghosts
from cubestack.emulator.scene.hazards.moon import Moon
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cameras.ov7620 import COLUMNS, EXPOSURE_LINES, ROWS

USUAL_EXPOSURE = {CameraTarget.SUN: 1, CameraTarget.NADIR: 4}
"""Counts of the exposure register for the published levels.

Sun: 127 us (published). Nadir: "set once", to an unpublished value; assumed.
"""

EARTH_LEVEL = 120.4
"""Grey values above black of radiance 1 in the nadir camera: fitted.

The whole Earth, from 750 km with the Sun behind the satellite, then has the published mean of 153,
119 above black.
"""

FILTER = {CameraTarget.SUN: 1e-4, CameraTarget.NADIR: 1.0}
"""Transmission (published)."""

SUN_EDGE = 65.0
"""Grey value above black at the edge of the Sun's image: 30 % of its level, 99 with black (5.7)."""

SUN_SPOT = 0.367
"""Standard deviation of the Sun's spot relative to its radius on the boresight: fitted.

With :func:`_slant_transmission`, the spot then shrinks from 8 px to the measured 6 px at the rim.
"""

PIXEL_MM, BACK_FOCAL_MM = 7.6e-3, 2.77
"""Appendix A.1 and A.3."""

FAINTEST = 1e-3
"""Light below this is neglected, grey values per line time."""

Light = NDArray[np.float32]


def scene_light(
    scene: EarthSunScene,
    camera: CameraTarget,
    bloom_px: float,
    time_ps: int,
    error: LensError = NOMINAL,
) -> Light:
    """Grey values (480, 640) above black per line time of exposure of ``camera``.

    ``bloom_px`` is the radius of the Sun's image on the boresight of the Sun camera, ``error`` the
    deviation of the lens.
    """
    lens = lens_of(camera, error)
    light = np.zeros((ROWS, COLUMNS), np.float32)
    sun = scene.in_camera_axes(scene.sun, camera, time_ps)
    earth_level = FILTER[camera] * EARTH_LEVEL / _usual_lines(CameraTarget.NADIR)
    lit, radiance = scene.earth.radiance(
        lens.field.vectors,
        lens.field.pixel_rad,
        scene.in_camera_axes(scene.nadir, camera, time_ps),
        sun,
        scene.axes(camera, time_ps),
    )
    radiance *= lens.field.lit[lit] * np.float32(earth_level)
    light.ravel()[lens.field.index[lit]] = radiance
    if not scene.hidden(scene.sun):
        _add_sun(light, lens, bloom_px, camera, sun)
    _add_hazards(light, lens, scene, camera, time_ps)
    for reflection in scene.reflections:
        if reflection.camera == camera:
            centre = lens.project(vector_from_angles(reflection.alpha_deg, reflection.beta_deg))
            assert centre is not None  # see check_field
            _add_disc(light, centre, reflection.radius_px, reflection.level / _usual_lines(camera))
    return light


def fisheye_state(scene: EarthSunScene, camera: CameraTarget, time_ps: int) -> sky.CameraState:
    """The state of ``camera`` for hazards, with the nominal lens."""
    return sky.CameraState(
        scene.axes(camera, time_ps),
        2 * FIELD_DEG,
        2 * FIELD_DEG,
        FIELD_DEG,
        float(lens_of(camera).field.pixel_rad.max()),
        time_ps / PS_PER_S,
    )


def _usual_lines(camera: CameraTarget) -> int:
    return USUAL_EXPOSURE[camera] * EXPOSURE_LINES


def _add_sun(
    light: Light, lens: Fisheye, bloom_px: float, camera: CameraTarget, vector: NDArray[np.float64]
) -> None:
    centre = lens.project(vector)
    if centre is None:
        return
    peak = SUN_EDGE * math.exp(1 / (2 * SUN_SPOT**2))
    unfiltered = peak / FILTER[CameraTarget.SUN] / _usual_lines(CameraTarget.SUN)
    transmission = _slant_transmission(FILTER[camera], math.dist(centre, (lens.cx, lens.cy)))
    _add_spot(light, centre, SUN_SPOT * bloom_px, unfiltered * float(transmission))


def _slant_transmission(straight: float, radius_px: ArrayLike) -> NDArray[np.float64]:
    """Transmission (...) of a filter behind the lens for light at ``radius_px`` (...).

    Assumed: the path through the filter is straight from the centre of the last lens element,
    without refraction. At the rim, a fifth of the filtered light remains.
    """
    slant = np.hypot(1, np.asarray(radius_px) * PIXEL_MM / BACK_FOCAL_MM)
    return np.asarray(straight**slant)


@dataclass(frozen=True, kw_only=True)
class _Disc(sky.SkyHazard):
    """The scene's Earth, which hides hazards."""

    nadir: tuple[float, ...]
    radius_rad: float

    name: ClassVar[str] = "earth"
    depth: ClassVar[sky.Depth] = sky.Depth.EARTH

    def hidden(self, state: sky.CameraState, vectors: sky.Vectors) -> NDArray[np.bool_]:
        del state
        return np.asarray(vectors @ np.array(self.nadir) > math.cos(self.radius_rad))


def _hazards(scene: EarthSunScene) -> list[sky.SkyHazard]:
    """The scene's hazards with its Sun, and its Moon as a hazard."""
    found = list(scene.hazards)
    if scene.moon is not None:
        found.append(Moon(direction=tuple(np.asarray(scene.moon).tolist()), scatter=0.0))
    sun = tuple(np.asarray(scene.sun).tolist())
    found = [
        replace(hazard, sun=sun)  # type: ignore[call-arg]
        if getattr(hazard, "sun", sun) is None
        else hazard
        for hazard in found
    ]
    if scene.hidden(scene.sun):
        found = [hazard for hazard in found if not isinstance(hazard, Ghosts)]
    return found


def _add_hazards(
    light: Light, lens: Fisheye, scene: EarthSunScene, camera: CameraTarget, time_ps: int
) -> None:
    hazards = _hazards(scene)
    if not hazards:
        return
    field, straight = lens.field, FILTER[camera]
    state = fisheye_state(scene, camera, time_ps)
    radius = math.radians(angular_radius_deg(scene.altitude_km))
    earth = _Disc(nadir=tuple(np.asarray(scene.nadir).tolist()), radius_rad=radius)
    level = EARTH_LEVEL / _usual_lines(CameraTarget.NADIR) / sky.EARTH_RADIANCE
    vectors = field.vectors.astype(np.float64) @ state.axes
    for hazard in hazards:
        points = hazard.lights(state)
        if points is None:
            continue
        behind = earth.hidden(state, points.vectors) & (hazard.depth < earth.depth)
        for vector, v_mag in zip(points.vectors[~behind], points.v_mag[~behind], strict=True):
            centre = lens.project(state.axes @ vector)
            if centre is not None:
                at = math.dist(centre, (lens.cx, lens.cy))
                flux = 10 ** (-0.4 * v_mag) / state.pixel_rad**2
                peak = flux * level / (2 * math.pi * SPOT_PX**2)
                _add_spot(light, centre, SPOT_PX, peak * float(_slant_transmission(straight, at)))
    glow = brightness([*hazards, earth], state, vectors)
    if glow is None:
        return
    places = np.divmod(field.index, COLUMNS)
    away = np.hypot(places[1] - lens.cx, places[0] - lens.cy)
    glow *= (_slant_transmission(straight, away) * level).astype(np.float32) * field.lit
    if glow.max() > FAINTEST:
        added = np.zeros_like(light)
        added.ravel()[field.index] = glow
        light += blur(added, SPOT_PX)


def _add_spot(light: Light, centre: NDArray[np.float64], sigma_px: float, peak: float) -> None:
    if peak > FAINTEST:
        reach = sigma_px * math.sqrt(2 * math.log(peak / FAINTEST))
        patch, distance2 = _patch(light, centre, reach)
        patch += np.float32(peak) * np.exp(distance2 * np.float32(-0.5 / sigma_px**2))


def _add_disc(light: Light, centre: NDArray[np.float64], radius_px: float, level: float) -> None:
    patch, distance2 = _patch(light, centre, radius_px + 1)
    patch += np.float32(level) * np.clip(radius_px + 0.5 - np.sqrt(distance2), 0, 1)


def _patch(light: Light, centre: NDArray[np.float64], reach: float) -> tuple[Light, Light]:
    """The part of the image around ``centre``, and its squared distances from there."""
    x, y = centre
    left, top = max(0, math.ceil(x - reach)), max(0, math.ceil(y - reach))
    patch = light[top : max(0, math.floor(y + reach) + 1), left : max(0, math.floor(x + reach) + 1)]
    rows, columns = patch.shape
    dx, dy = np.arange(left, left + columns) - x, np.arange(top, top + rows) - y
    return patch, (dx * dx + (dy * dy)[:, None]).astype(np.float32)


REACH_SIGMAS = 4.0


def blur(light: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    """``light`` (rows, columns) with spots of this standard deviation; dark beyond the edges."""
    half = math.ceil(REACH_SIGMAS * sigma_px)
    edges = (np.arange(2 * half + 2) - half - 0.5) / (sigma_px * math.sqrt(2))
    shares = np.diff([math.erf(edge) for edge in edges])
    shares /= shares.sum()
    return _along_rows(_along_rows(light, shares).T, shares).T


def _along_rows(light: NDArray[np.float32], shares: NDArray[np.float64]) -> NDArray[np.float32]:
    half, columns = len(shares) // 2, light.shape[1]
    wide = np.pad(light, ((0, 0), (half, half)))
    total = np.zeros_like(light)
    for first, share in enumerate(shares):
        total += np.float32(share) * wide[:, first : first + columns]
    return total
