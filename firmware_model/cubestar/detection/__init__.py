"""Detection of stars in an image: the published search, and the one above the background.

A search yields the pixels that it reads and writes in order; the caller performs the accesses, on
an array or on a memory behind an FPGA.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection.background_search import background_search
from cubestack.firmware_model.cubestar.detection.contract import (
    Detection,
    DetectionConfig,
    DetectionConfigError,
    Look,
    PictureStatistics,
    Put,
    Search,
    SearchEnd,
)
from cubestack.firmware_model.cubestar.detection.sampled import sampled_search
from cubestack.firmware_model.mcu.costs import Meter

__all__ = [
    "Detection",
    "DetectionConfig",
    "DetectionConfigError",
    "Look",
    "PictureStatistics",
    "Put",
    "Search",
    "SearchEnd",
    "detect_stars",
    "search_stars",
]


def detect_stars(image: NDArray[np.uint8], config: DetectionConfig, meter: Meter) -> Detection:
    """Find the stars of an image (rows, columns) of 8-bit values, which is not changed.

    Charges what ``search_stars`` charges, and every access. Raises DetectionConfigError when the
    region reaches beyond the image.
    """
    rows, columns = image.shape
    pixels = image.reshape(-1).copy()
    search, answer = search_stars(rows, columns, config, meter), None
    while True:
        try:
            access = search.send(answer)
        except StopIteration as done:
            detection: Detection = done.value
            return detection
        match access:
            case Look():
                values = pixels[access.offsets]
                above = np.flatnonzero(values > access.above)
                answer = values[: above[0] + 1] if len(above) else values
                meter.charge(ebi_read=len(answer))
            case Put():
                pixels[access.offsets] = access.values
                meter.charge(ebi_write=len(access.offsets))


def search_stars(rows: int, columns: int, config: DetectionConfig, meter: Meter) -> Search:
    """Find the stars of an image of ``rows`` by ``columns`` 8-bit values; phases `search` and
    `centroid`. The yielded accesses are not charged. Raises as ``detect_stars`` does."""
    config.check_region(rows, columns)
    search = background_search if config.background else sampled_search
    return search(rows, columns, config, meter)
