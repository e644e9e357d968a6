"""Cost of the search for stars: the part's operations for each thing done.

Masks and histograms are bytes of the processor's own memory, pictures are in external memory.
"""

from math import ceil, log2

import numpy as np

from cubestack.firmware_model.aramis.detection.mask import WINDOW, SpikeRemoval
from cubestack.firmware_model.aramis.detection.regions import Regions
from cubestack.firmware_model.aramis.detection.spots import LARGEST, RING, StarSpots
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.background import BLOCK, CELL, SkyBackground


def charge_background(sky: SkyBackground, meter: Meter) -> None:
    """Histograms of levels and differences, filled and added up to the quartiles; medians of
    neighbouring cells."""
    filled, cells = sky.samples + sky.differences, sky.levels.size
    meter.charge(pixel_read=filled, i32_add=2 * filled, table_byte=filled, loop=filled)
    meter.charge(table_byte=2 * 512 * cells, i32_add=512 * cells, i32_mul=256 * cells)
    meter.charge(i32_add=30 * cells, table_byte=9 * cells, loop=(512 + 9) * cells)


def charge_thresholds(height: int, width: int, meter: Meter) -> None:
    """Each pixel compared with the threshold of its block; its step is calculated for each row of a
    cell."""
    pixels, blocks = height * width, height * -(-width // BLOCK)
    steps = height * -(-width // CELL)
    meter.charge(pixel_read=pixels, i32_add=pixels, ram_write=pixels // 4, loop=pixels)
    meter.charge(i32_add=6 * blocks + 12 * steps, i32_mul=4 * steps, table_byte=4 * steps)
    meter.charge(loop=blocks)


def charge_spikes(shape: tuple[int, int], method: SpikeRemoval, cleared: int, meter: Meter) -> None:
    """Method 1: two running sums, an addition and a subtraction for each pixel. Method 2: all
    pixels added up, the windows compared, and some ``cleared``."""
    pixels = shape[0] * shape[1]
    if method is SpikeRemoval.CENTRE:
        meter.charge(table_byte=4 * pixels, i32_add=5 * pixels, loop=2 * pixels)
        meter.charge(ram_write=2 * pixels)
    elif method is SpikeRemoval.WINDOW:
        steps = pixels + -(-shape[0] // WINDOW) * -(-shape[1] // WINDOW)
        meter.charge(table_byte=pixels, i32_add=steps, loop=steps, ram_write=cleared * WINDOW**2)


def charge_regions(mask_size: int, regions: Regions | None, meter: Meter) -> None:
    """The mask looked through, and its runs joined."""
    meter.charge(table_byte=mask_size, i32_add=mask_size, loop=mask_size)
    if regions is not None:
        runs, looks = regions.runs, regions.comparisons
        meter.charge(ram_read=6 * looks + 2 * runs, ram_write=looks + 3 * runs)
        meter.charge(i32_add=4 * looks + 2 * runs, loop=looks + runs)


def charge_centroids(regions: Regions, stars: int, meter: Meter) -> None:
    """Sums of the grey levels of all regions, quotients, and the ``stars`` sorted."""
    pixels, count = len(regions.labels), regions.count
    meter.charge(pixel_read=pixels, ram_read=2 * pixels, i32_add=6 * pixels, i32_mul=2 * pixels)
    meter.charge(f32_convert=5 * count, f32_div=2 * count, f32_add=2 * count, loop=pixels + count)
    _charge_sorting(stars * ceil(log2(stars + 1)), meter)


def charge_smear(regions: Regions, meter: Meter) -> None:
    """The largest regions found, and their second moments."""
    sizes = np.sort(regions.sizes)[::-1][:LARGEST]
    pixels, count = int(sizes.sum()), len(sizes)
    meter.charge(ram_read=3 * pixels, f32_convert=3 * pixels, f32_div=5 * count, f32_sqrt=2 * count)
    meter.charge(f32_mul=8 * pixels, f32_add=6 * pixels, loop=pixels)
    every = len(regions.labels)
    meter.charge(i32_add=every, loop=every + LARGEST * regions.count)


def charge_spots(regions: Regions, sizes: tuple[int, int], spots: StarSpots, meter: Meter) -> None:
    """Hot pixels, rings and moments of regions of ``sizes``; the stars among them sorted."""
    every = len(regions.labels)
    fit = regions.sizes[(regions.sizes >= sizes[0]) & (regions.sizes <= sizes[1])]
    light, found, ring = int(fit.sum()), len(fit), len(fit) * RING
    meter.charge(ram_read=every, i32_add=every)
    meter.charge(pixel_read=8 * light, i32_add=16 * light, loop=8 * light)
    meter.charge(pixel_read=9 * ring, i32_add=18 * ring, i32_mul=2 * ring, loop=10 * ring)
    meter.charge(i32_add=5 * ring, table_byte=5 * ring)
    meter.charge(pixel_read=light, i32_add=14 * light, i32_mul=9 * light, loop=light)
    meter.charge(f32_convert=8 * found, f32_div=10 * found, f32_sqrt=4 * found, f32_atan2=found)
    meter.charge(f32_mul=20 * found, f32_add=15 * found, f32_compare=4 * found, loop=found)
    _charge_sorting(len(spots) * max(len(spots), 1).bit_length(), meter)


def charge_tracks(spots: StarSpots, meter: Meter) -> None:
    """Directions of the brightest spots that are long."""
    count = int(np.count_nonzero(spots.length_px[: 2 * LARGEST] > 0))
    meter.charge(f32_sin=4 * count, f32_atan2=count, f32_add=6 * count, f32_sqrt=2)


def _charge_sorting(steps: int, meter: Meter) -> None:
    meter.charge(f32_compare=steps, ram_read=steps, ram_write=steps, loop=steps)
