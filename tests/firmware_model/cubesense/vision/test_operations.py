from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.vision.circle import LeastSquaresCircle
from cubestack.firmware_model.cubesense.vision.distortion import (
    DISTORTION,
    Projection,
    RadiusTable,
    byte_table,
    fine_table,
)
from cubestack.firmware_model.cubesense.vision.edges import EdgeConfig, EdgeList, run_search
from cubestack.firmware_model.cubesense.vision.lens_check import invertible
from cubestack.firmware_model.cubesense.vision.masks import Mask
from cubestack.firmware_model.cubesense.vision.nadir import NadirConfig, find_nadir
from cubestack.firmware_model.cubesense.vision.sample_search import Between, around_samples
from cubestack.firmware_model.cubesense.vision.sun_centroid import SunConfig, find_sun
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20

from ...operations import as_on_record
from ..scenery import chequered, earth, edges_in, rough, sun, window

PICTURES = {
    "Earth": earth(5, -7),
    "Earth at the rim": earth(60, 20),
    "rough": rough(np.random.default_rng(1)),
    "chequered": chequered(),
    "dark": np.full((480, 640), 34, np.uint8),
}
SEARCHES = {
    "": EdgeConfig(),
    "whole pixels": EdgeConfig(sub_pixel=False),
    "listing": EdgeConfig(sub_pixel=False, listing=True),
    "sharp": EdgeConfig(sharp=True),
    "masked": EdgeConfig(masks=(Mask(0, 371, 0, 479), Mask(600, 630, 10, 20))),
}
LIGHTS = {
    "Sun": (300.3, 200.6, 6.0),
    "cut Sun": (2.0, 250.0, 6.0),
    "large Sun": (300.3, 200.6, 9.0),
    "light beyond the field": (600.0, 20.0, 6.0),
}


def table(projection: Projection) -> RadiusTable:
    return fine_table(Meter(PIC18F45K20), projection)


def numbers(found: Any) -> list[float]:
    return [float(getattr(value, "value", value)) for value in vars(found).values()]


def of_edges(edges: EdgeList) -> list[int]:
    """How many there are, were dropped, and where they are, in all."""
    return [len(edges), edges.false, edges.full, *edges.points.astype(int).sum(axis=0).tolist()]


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("picture", PICTURES)
def test_edges(meter: Meter, picture: str, search: str) -> None:
    edges = edges_in(PICTURES[picture], meter, SEARCHES[search])
    edges.offsets()
    as_on_record(f"edges: {picture}, {search}", meter, of_edges(edges))


@pytest.mark.parametrize("sharp", [False, True])
@pytest.mark.parametrize("between", Between)
@pytest.mark.parametrize("picture", PICTURES)
def test_samples(meter: Meter, picture: str, between: Between, sharp: bool) -> None:
    pixels = PICTURES[picture]
    config = EdgeConfig(sharp=sharp)
    search = around_samples(config, meter, between)
    edges = run_search(search, lambda at: int(pixels[at[1], at[0]]))
    as_on_record(f"samples: {picture}, {between.name}, sharp {sharp}", meter, of_edges(edges))


@pytest.mark.parametrize("checked", [False, True])
@pytest.mark.parametrize("projection", Projection)
@pytest.mark.parametrize("picture", PICTURES)
def test_nadir(meter: Meter, picture: str, projection: Projection, checked: bool) -> None:
    found = edges_in(PICTURES[picture], meter, SEARCHES["sharp"])
    config = NadirConfig(table(projection), projection, checked=checked)
    result = numbers(find_nadir(found, config, meter))
    as_on_record(f"nadir: {picture}, {projection.name}, checked {checked}", meter, result, 2)


@pytest.mark.parametrize("printed", [False, True])
@pytest.mark.parametrize("light", LIGHTS)
def test_sun(meter: Meter, light: str, printed: bool) -> None:
    *centre, bloom_px = LIGHTS[light]
    config = SunConfig(table(Projection.EQUIDISTANT), printed=printed)
    result = numbers(find_sun(window(sun(np.array(centre), bloom_px)), config, meter))
    as_on_record(f"Sun: {light}, printed {printed}", meter, result, 2)


@pytest.mark.parametrize("printed", [False, True])
def test_no_sun(meter: Meter, printed: bool) -> None:
    config = SunConfig(table(Projection.EQUIDISTANT), printed=printed)
    result = numbers(find_sun(window(PICTURES["dark"]), config, meter))
    as_on_record(f"Sun: none, printed {printed}", meter, result)


@pytest.mark.parametrize("name", ["bytes", *(projection.name for projection in Projection)])
def test_tables(meter: Meter, name: str) -> None:
    made = byte_table(meter) if name == "bytes" else fine_table(meter, Projection[name])
    as_on_record(f"table: {name}", meter, made.differences.tolist(), 1)


@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0])
def test_lens_check(meter: Meter, slope: float) -> None:
    found = invertible([DISTORTION[0], slope, *DISTORTION[2:]], meter)
    as_on_record(f"lens check: {slope}", meter, [found])


def test_listed_circle(meter: Meter) -> None:
    rng = np.random.default_rng(3)
    angles = rng.uniform(0, 2 * np.pi, 9)
    points = np.column_stack([40 + 90 * np.cos(angles), 90 * np.sin(angles) - 20])
    centre = LeastSquaresCircle(points.astype(np.float32), meter).centre()
    assert centre is not None
    as_on_record("listed circle", meter, [*centre], 0.01)
