"""The grid algorithm: a pattern of cells around each star, against one pattern per listed star.

CubeStar thesis, section 4.2.1.3 (after Padgett and Kreutz-Delgado 1997); AraMiS thesis, section
5.2. A star's neighbours are turned until the nearest one beyond a small radius lies on the first
axis; each neighbour fills a cell. The listed star whose pattern shares the most cells is the name,
and names that contradict each other leave.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import Catalogue, MeasuredAngles
from cubestack.host.studies.compare.identification.agreement import FEWEST, agreeing
from cubestack.host.studies.compare.tracker import NONE, Image, Indices

Vectors = NDArray[np.float64]

CELLS = 32  #: along each side of the grid (chosen)
NEAREST_PX = 20  #: neighbours closer than this do not turn the pattern (chosen)
FEWEST_SHARED = 3  #: cells, of which the turning star is one


class Grid:
    """A pattern has a bit for each cell of a square about the star, as wide as the field's shorter
    side."""

    def __init__(self, catalogue: Catalogue) -> None:
        tracker = catalogue.tracker
        self.vectors, self.margin, self.used = catalogue.vectors, tracker.margin_rad, tracker.used
        self.reach = tracker.half_field_rad
        self.nearest = NEAREST_PX / tracker.focal_px
        cells = [self._cells(self.vectors, star) for star in range(len(self.vectors))]
        self.patterns = np.zeros((len(cells), CELLS * CELLS), np.float32)
        for star, filled in enumerate(cells):
            self.patterns[star, filled] = 1
        self.database_bytes = self.patterns.size // 8 + catalogue.star_bytes
        self.ram_bytes = CELLS * CELLS // 8 + 4 * self.used

    def __call__(self, image: Image, meter: Meter) -> Indices:
        count = min(self.used, len(image.rays))
        rays = image.rays[:count].astype(np.float64)
        names = np.full(len(image.rays), NONE)
        for star in range(count):
            filled = self._cells(rays, star)
            shared = self.patterns[:, filled].sum(axis=1)
            self._charge(count, len(filled), meter)
            best = int(shared.argmax())
            unique = np.count_nonzero(shared == shared[best]) == 1
            names[star] = best if unique and shared[best] >= FEWEST_SHARED else NONE
        measured = MeasuredAngles(image.rays, meter)
        names = agreeing(names, measured.all, self.vectors, self.margin, meter)
        if np.count_nonzero(names != NONE) < FEWEST:
            names[:] = NONE
        return names

    def _cells(self, vectors: Vectors, star: int) -> Indices:
        """Distinct cells that the neighbours of a star fill; none without one to turn by."""
        centre = vectors[star]
        cosine = vectors @ centre
        near = np.flatnonzero(cosine > np.cos(self.reach))
        near = near[near != star]
        turning = near[cosine[near] < np.cos(self.nearest)]
        if not len(turning):
            return np.zeros(0, np.intp)
        align = vectors[turning[cosine[turning].argmax()]]
        across = align - (align @ centre) * centre
        across /= np.linalg.norm(across)
        axes = np.stack([across, np.cross(centre, across)])
        flat = vectors[near] @ axes.T / cosine[near, None] / np.tan(self.reach)
        # The first axis is the middle of a row of cells, or noise would decide about the row.
        place = np.floor(flat * (CELLS / 2 - 0.5) + CELLS / 2 + np.array([0, 0.5])).astype(np.intp)
        place = np.clip(place, 0, CELLS - 1)
        return np.unique(place[:, 1] * CELLS + place[:, 0])

    def _charge(self, count: int, filled: int, meter: Meter) -> None:
        # Who is near, the axes, and each neighbour's cell.
        meter.charge(f32_mul=3 * count + 12, f32_add=2 * count + 8, f32_compare=2 * count)
        meter.charge(f32_sqrt=1, f32_div=3 + filled, f32_mul=8 * filled, f32_add=6 * filled)
        meter.charge(f32_convert=2 * filled, ram_write=filled, loop=count + filled)
        # The linear search: a bit of each listed pattern for each filled cell.
        bits = filled * len(self.patterns)
        meter.charge(flash_read=bits, i32_add=2 * bits, loop=bits)
