"""Light of a sphere with an uneven surface, day and night, and a glow above its limb.

`reference` is NumPy; `globe.cpp` does the same operations in the same order, so both are equal to
the bit. That is why sine, exponential function and scalar products are spelled out here.
"""

import ctypes
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.light.library import GlobeRecord, Library, address, light_library

Values = NDArray[np.float32]
Vector = NDArray[np.float64]

#: Taylor's series: sin(pi r) / r by powers of r squared, to 6e-8; 2 ** f by powers of f, to 2e-7,
#: both for -0.5 to 0.5.
SINE = np.array([(-1) ** n * math.pi ** (2 * n + 1) / math.factorial(2 * n + 1) for n in range(6)])
EXP2 = np.array([math.log(2) ** n / math.factorial(n) for n in range(7)])
LOG2_E = np.float32(1 / math.log(2))
SMALLEST = np.float32(-126)  # power of two
TO_WHOLE = np.float32(1.5 * 2**23)  # added and subtracted, it rounds to the nearest whole number


@dataclass(frozen=True, eq=False)
class Globe:
    """A sphere of radius 1; all vectors in the same axes."""

    distance: float  #: of its centre, above 1
    centre: Vector  #: direction (3,) of its centre, a unit vector
    sun: Vector  #: direction (3,) of the light, a unit vector
    twilight: float  #: sine of the light's height in which day changes to night
    glow: float  #: scale height of the glow; 0 for none
    glow_heights: float  #: scale heights above which it is neglected
    waves: Vector  #: wave vectors (n, 3) of the uneven surface, turns per radius
    phases: Vector  #: of the waves (n,), turns
    unevenness: float  #: factor on the sum of their cosines

    def numbers(self, pixel_rad: float) -> dict[str, np.float32]:
        """What both forms compute with, for pixels of at most this size."""
        radius = math.asin(1 / self.distance)
        rise = self.distance * math.cos(radius)  # of a line of sight above the limb, per angle
        reach = pixel_rad + self.glow_heights * self.glow / rise
        distance = np.float32(self.distance)
        return {
            "limit": np.float32(math.cos(radius + reach)),
            "distance": distance,
            "square": distance * distance,
            "twilight": np.float32(self.twilight**2),
            "cosine": np.float32(math.cos(radius)),
            "sine": np.float32(math.sin(radius)),
            "per_height": np.float32(rise / self.glow if self.glow else 0),
            "unevenness": np.float32(self.unevenness),
        }


def radiance(vectors: Values, pixel_rad: Values, globe: Globe) -> tuple[NDArray[np.int64], Values]:
    """Mean radiance over small round pixels; 1 is that of the surface below the light.

    Args:
        vectors: lines of sight (n, 3), unit vectors.
        pixel_rad: angle (n,) that each pixel spans.
        globe: what they look at.

    Returns:
        Indices (m,) of the lines of sight that meet the sphere or its glow, ascending, and radiance
        (m,).
    """
    library = light_library()
    if library is None:
        return reference(vectors, pixel_rad, globe)
    return compiled(library, vectors, pixel_rad, globe)


def reference(vectors: Values, pixel_rad: Values, globe: Globe) -> tuple[NDArray[np.int64], Values]:
    """The same by NumPy."""
    n = globe.numbers(float(pixel_rad.max()))
    cosine = _dot(vectors.T, globe.centre.astype(np.float32))
    hit = np.flatnonzero(cosine > n["limit"])
    cosine, pixel_rad = cosine[hit], pixel_rad[hit]
    normal = _normals(vectors[hit].T, cosine, globe, n)
    sine = _dot(normal, globe.sun.astype(np.float32))
    light = (sine + np.sqrt(sine * sine + n["twilight"])) * np.float32(0.5)
    light *= _share(cosine, pixel_rad, n)
    if globe.unevenness:
        pattern = np.zeros_like(light)
        for wave, phase in zip(*_waves(globe), strict=True):
            pattern += _cosine(_dot(normal, wave) + phase)
        light *= np.maximum(pattern * n["unevenness"] + np.float32(1), 0)
    return hit, light


def normals(vectors: Values, globe: Globe) -> Values:
    """Where lines of sight (n, 3) meet the sphere first, or are closest to it, from its centre."""
    cosine = _dot(vectors.T, globe.centre.astype(np.float32))
    return np.stack(_normals(vectors.T, cosine, globe, globe.numbers(0.0)), axis=1)


def compiled(
    library: Library, vectors: Values, pixel_rad: Values, globe: Globe
) -> tuple[NDArray[np.int64], Values]:
    """The same by the compiled library."""
    vectors, pixel_rad = np.ascontiguousarray(vectors), np.ascontiguousarray(pixel_rad)
    waves, phases = _waves(globe) if globe.unevenness else (np.zeros((0, 3)), np.zeros(0))
    table = np.concatenate([waves, phases[:, None]], axis=1).astype(np.float32)
    floats = {
        "centre": globe.centre,
        "closest": globe.distance * globe.centre,
        "sun": globe.sun,
        "sine_series": SINE,
        "exp2_series": EXP2,
    }
    record = GlobeRecord(
        **globe.numbers(float(pixel_rad.max())),
        **{name: tuple(map(float, one)) for name, one in floats.items()},
        to_whole=TO_WHOLE,
        log2_e=LOG2_E,
        smallest=SMALLEST,
        waves=len(table),
        table=address(table),
    )
    hit, light = np.empty(len(vectors), np.int64), np.empty(len(vectors), np.float32)
    count = library.light_globe(
        ctypes.byref(record),
        address(vectors),
        address(pixel_rad),
        len(vectors),
        address(hit),
        address(light),
    )
    return hit[:count], light[:count]


def _waves(globe: Globe) -> tuple[Values, Values]:
    return globe.waves.astype(np.float32), globe.phases.astype(np.float32)


def _dot(vectors: Values | tuple[Values, ...], other: Values) -> Values:
    """Scalar products (n,) of vectors (3, n) and a vector (3,)."""
    x, y, z = vectors
    product: Values = x * other[0] + y * other[1] + z * other[2]
    return product


def _normals(
    sight: Values, cosine: Values, globe: Globe, n: dict[str, np.float32]
) -> tuple[Values, ...]:
    one = np.float32(1)
    half_chord = np.sqrt(np.maximum(one - n["square"] * (one - cosine * cosine), 0))
    along = n["distance"] * cosine - half_chord
    closest = (globe.distance * globe.centre).astype(np.float32)
    return tuple(axis * along - away for axis, away in zip(sight, closest, strict=True))


def _share(cosine: Values, pixel_rad: Values, n: dict[str, np.float32]) -> Values:
    """Share of each pixel that the surface fills, plus the glow's light in the rest."""
    half = np.float32(0.5)
    # Angle above the limb in pixels, linear in the cosine, which is accurate near the limb.
    above = (n["cosine"] - cosine) / (n["sine"] * pixel_rad)
    share: Values = np.clip(half - above, 0, 1)
    if n["per_height"]:
        limb = np.flatnonzero(above > -half)
        heights = pixel_rad[limb] * n["per_height"]
        low, high = (np.maximum(above[limb] + side, 0) * heights for side in (-half, half))
        share[limb] += (_exp(-low) - _exp(-high)) / heights
    return share


def _cosine(turns: Values) -> Values:
    r = turns - ((turns + TO_WHOLE) - TO_WHOLE)
    sine = r * _series(SINE, r * r)
    cosine: Values = np.float32(1) - np.float32(2) * (sine * sine)
    return cosine


def _exp(x: Values) -> Values:
    power = np.maximum(x * LOG2_E, SMALLEST)
    whole = (power + TO_WHOLE) - TO_WHOLE
    scale = ((whole.astype(np.int32) + np.int32(127)) << 23).view(np.float32)
    value: Values = _series(EXP2, power - whole) * scale
    return value


def _series(coefficients: NDArray[np.float64], x: Values) -> Values:
    """Polynomial of ``x`` (n,), by Horner's rule in float32."""
    *others, last = coefficients.astype(np.float32)
    value = np.full_like(x, last)
    for coefficient in reversed(others):
        value *= x
        value += coefficient
    return value
