"""Shape tests and weighted centroids of bright spots.

A centroid is the place about which the signal, weighted with a Gaussian of the spots' own width, is
balanced: unbiased where a window cuts the spot, and as accurate as a fit. The width is the median
of the image's stars. Signal above the Gaussian, a hot pixel or a neighbour, is replaced by it. The
program uses whole numbers and a table of weights; only the last division is in floating point.

Expected errors are Cramer-Rao bounds of a Gaussian spot of width s and light F: n s^2 sqrt(8 pi) /
F for noise n in each pixel, s / sqrt(electrons) for the light's own noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

HALF = 4
SIDE = 2 * HALF + 1  #: pixels of a window to each side of the brightest one, and along its side

#: Width of the weights of a saturated spot, whose middle is flat, and of those that measure it.
WIDE_SIGMA_PX = 1.5

USUAL_SIGMA_PX = 0.95  #: width of a star's spot and a pixel together, where too few stars tell it

SIGMA_RANGE_PX = 0.5, 2.0
FEWEST_SPOTS = 3
SHAPE_ROUNDS = 5
SATURATED_DN = 250
ROUNDS = 4
#: Largest share of the brightest pixel in the 3 x 3 around it: 0.22 in a spot of sigma 0.9 px, 0.54
#: in one of 0.45 px, and more in what particles and hot pixels leave; chosen.
SHARPEST = 0.6

#: Number of brightest round spots that define the usual width, and share of them that have at
#: most this width: chosen.
MOST_WIDTHS, USUAL_SHARE = 24, 0.6

#: Share of a spot that may stand out above the Gaussian of its own width where it tells the usual
#: one; chosen.
ROUND = 0.05

#: Parts of the usual width between which a spot is a star's: a saturated one is wider. Of protons'
#: tracks half are narrower, of stars none; haze is wider.
NARROW, NARROW_SATURATED, WIDE = 0.65, 0.9, 1.9

#: Share of a star's light that may stand out: with 20 000 hot pixels it is 0.4 for one star in a
#: hundred, and more for half of the protons' tracks.
MOST_DISTURBED = 0.5

#: Share of a spot's height by which a pixel may exceed its Gaussian, beside four times the noise:
#: what a spot is that is no Gaussian; chosen.
STANDS_OUT = 0.15

DISTURBED_PX = 0.5  #: expected error in px for each part of the light that was replaced: measured
ELECTRONS_PER_DN = 36.5  #: MLX75412: 2.28 electrons per count of 12 bits, whose upper 8 are here

LEAST_ERROR_PX = 0.01
#: What uneven pixels leave of bright stars, and a flat middle besides: measured, with a margin.
SATURATED_ERROR_PX = 0.04

_PARTS = 64  #: of a pixel: places between which the weights are tabulated
_ONE = 256  #: weight in the middle

_CELLS = _PARTS * np.arange(-HALF, HALF + 1)

Ints = NDArray[np.int64]
Reals = NDArray[np.float64]
Marks = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Centroids:
    """Places (n, 2) x and y from the windows' middles, light in DN and expected errors in px."""

    places: NDArray[np.float32]
    light: NDArray[np.float32]
    errors: NDArray[np.float32]


def too_sharp(windows: Ints, noises: Ints) -> NDArray[np.bool_]:
    """Which windows' middles are sharper than a spot; signal (n, 9, 9) and noise in 1/16 DN."""
    near = windows[:, HALF - 1 : HALF + 2, HALF - 1 : HALF + 2].sum(axis=(1, 2))
    sharp: NDArray[np.bool_] = windows[:, HALF, HALF] - noises > SHARPEST * near
    return sharp


def shapes(windows: Ints, starts: Reals, saturated: Marks, noises: Ints) -> tuple[Marks, float]:
    """Which ``windows`` contain a star, and the width of the stars' spots in px.

    A spot of variance v has 1 / (1/v + 1/w) under weights of variance w. The usual width is that of
    the brightest round spots: particles leave narrow ones, haze faint and wide ones. Arguments as
    for ``centre``; the brightest window comes first.
    """
    at, count = _in_parts(starts), len(windows)
    variances = _Weights.about(at, np.full(count, WIDE_SIGMA_PX)).variances(windows)
    free = 1 / np.maximum(1 / np.maximum(variances, 0.05) - 1 / WIDE_SIGMA_PX**2, 0.05)
    own = np.sqrt(np.clip(free, 0.1, None))
    round_ones = (_disturbed(windows, at, own, noises) < ROUND) & ~saturated
    usual = USUAL_SIGMA_PX
    if np.count_nonzero(round_ones) >= FEWEST_SPOTS:
        widths = own[round_ones][:MOST_WIDTHS]
        usual = float(np.clip(np.quantile(widths, USUAL_SHARE), *SIGMA_RANGE_PX))
    disturbed = _disturbed(windows, at, np.full(count, usual), noises)
    star = own > usual * np.where(saturated, NARROW_SATURATED, NARROW)
    star &= saturated | ((disturbed < MOST_DISTURBED) & (own < usual * WIDE))
    return star, usual


def _disturbed(windows: Ints, at: Ints, sigmas: Reals, noises: Ints) -> Reals:
    """Weighted share (n,) of the light that stands out above a Gaussian of ``sigmas`` (n,) px."""
    around = _Weights.about(at, np.clip(sigmas, *SIGMA_RANGE_PX))
    clean = around.cleaned(windows, windows, noises)
    return around.share(windows, around.cleaned(clean, windows, noises))


def centre(windows: Ints, starts: Reals, saturated: Marks, noises: Ints, sigma: float) -> Centroids:
    """Centroids of ``windows``: signal (n, 9, 9) in 1/16 DN around the brightest pixel of a spot.

    Args:
        starts: (n, 2) first places from the windows' middles, in px.
        saturated: (n,) whose flat middle has no information, so they are weighted more widely.
        noises: (n,) of a pixel in 1/16 DN.
        sigma: of a spot in px.
    """
    spread = np.where(saturated, np.maximum(WIDE_SIGMA_PX, sigma), sigma)
    # Weighed with its own width, a spot moves by half of what is missing.
    gain = 1 + (spread / sigma) ** -2
    at, clean = _in_parts(starts), windows
    for turn in range(ROUNDS):
        around = _Weights.about(at, spread)
        if turn:
            clean = np.where(
                saturated[:, None, None], windows, around.cleaned(clean, windows, noises)
            )
        step = gain[:, None] * around.means(clean)
        if turn < ROUNDS - 1:
            at = np.clip(at + np.rint(step).astype(np.int64), -2 * _PARTS, 2 * _PARTS)
    places = np.clip((at + step) / _PARTS, -2.5, 2.5)
    light = np.maximum(clean.sum(axis=(1, 2)) / 16, 1)
    disturbed = around.share(windows, clean)
    errors = np.sqrt(
        (noises / 16 * sigma**2 * np.sqrt(8 * np.pi) / light) ** 2
        + sigma**2 / (ELECTRONS_PER_DN * light)
        + np.where(saturated, SATURATED_ERROR_PX, LEAST_ERROR_PX) ** 2
        + (DISTURBED_PX * disturbed) ** 2
    )
    return Centroids(places.astype(np.float32), light.astype(np.float32), errors.astype(np.float32))


@dataclass(frozen=True, eq=False)
class _Weights:
    """Gaussian weights about a place in each window, and distances from it in 1/64 px: (n, 9)."""

    wx: Ints
    wy: Ints
    across: Ints
    down: Ints

    @classmethod
    def about(cls, at: Ints, sigmas: Reals) -> "_Weights":
        """Weights of ``sigmas`` (n,) px about the places ``at`` (n, 2) in 1/64 px."""
        away = [_CELLS - at[:, axis, None] for axis in (0, 1)]
        wx, wy = (
            np.rint(_ONE * np.exp(-((d / _PARTS / sigmas[:, None]) ** 2) / 2)).astype(np.int64)
            for d in away
        )
        return cls(wx, wy, *away)

    def sums(self, windows: Ints) -> Ints:
        return _weighed(windows, self.wx, self.wy)

    def means(self, windows: Ints) -> Reals:
        """Weighted mean places (n, 2) in 1/64 px, from where the weights are largest."""
        x = _weighed(windows, self.wx * self.across, self.wy)
        y = _weighed(windows, self.wx, self.wy * self.down)
        return np.stack([x, y], axis=1) / np.maximum(self.sums(windows), 1)[:, None]

    def variances(self, windows: Ints) -> Reals:
        """Mean (n,) of the weighted variances in x and y, in px^2."""
        x = _weighed(windows, self.wx * self.across**2, self.wy)
        y = _weighed(windows, self.wx, self.wy * self.down**2)
        squares = (x + y) / np.maximum(self.sums(windows), 1)
        variances: Reals = (squares - (self.means(windows) ** 2).sum(axis=1)) / (2 * _PARTS**2)
        return variances

    def share(self, windows: Ints, clean: Ints) -> Reals:
        """Weighted light (n,) that was taken out of ``windows``, in parts of what is left."""
        share: Reals = self.sums(windows - clean) / np.maximum(self.sums(clean), 1)
        return share

    def cleaned(self, clean: Ints, windows: Ints, noises: Ints) -> Ints:
        """``windows`` with the Gaussian that fits ``clean`` where they stand out above it."""
        shape = (self.wy[:, :, None] * self.wx[:, None, :]) / _ONE**2
        height = np.maximum((shape * clean).sum(axis=(1, 2)) / (shape**2).sum(axis=(1, 2)), 0)
        spots = shape * height[:, None, None]
        light_noise = np.sqrt(16 * spots / ELECTRONS_PER_DN)
        reach = 4 * (noises[:, None, None] + light_noise) + STANDS_OUT * height[:, None, None]
        cleaned: Ints = np.where(windows > spots + reach, spots, windows).astype(np.int64)
        return cleaned


def _weighed(windows: Ints, wx: Ints, wy: Ints) -> Ints:
    by_row = (windows * wx[:, None, :]).sum(axis=2)
    total: Ints = (by_row * wy).sum(axis=1)
    return total


def _in_parts(places: Reals) -> Ints:
    parts: Ints = np.rint(np.clip(places, -1.5, 1.5) * _PARTS).astype(np.int64)
    return parts
