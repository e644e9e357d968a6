"""Planets and the Moon as known objects: switch ``bodies``.

CubeStar thesis, section 7.2, proposes to track both. A planet joins the star list for the image: it
has no pairs there, so it proposes no attitude, but tracking finds it and an attitude is confirmed
by it as by a star. One that is known less well than a star is measured keeps its identity and is
left out of the attitude. The Moon's disc is found by its size and brightness, before anything is
identified, and hides the false stars around it. An attitude that puts the Moon elsewhere is
refused. The middle of its lit part is up to a radius from the Moon's, so this is coarse.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import (
    CameraParameters,
    turned,
    undistort,
    unit_vectors,
)
from cubestack.firmware_model.cubestar.body_list import Body
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.detection.disc import LARGEST_PX, SeenDisc, is_inside
from cubestack.firmware_model.cubestar.matching.identification import NONE, Identification
from cubestack.firmware_model.cubestar.processing.identify import Results
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import Disc
from cubestack.firmware_model.interface.cubestar.extensions import FIRST_BODY
from cubestack.firmware_model.mcu.costs import Meter

#: Accuracy up to which a body counts in the attitude: a star's expected error of 0.2 px.
GOOD_RAD = 2e-4

#: Largest distance between the Moon and the middle of its lit part and glare, beyond the radius:
#: chosen.
DISC_MARGIN_RAD = 0.009

#: Centroids within this many radii of the saturated glare, and 6 px more, are not those of stars.
GLARE, GLARE_PX = 1.25, 6

NO_BODIES: dict[str, Value] = INTERFACE.telemetry("Bodies").reset_values()
"""Values of telemetry Bodies without any."""

_ROUNDS = 4  #: of the distortion's inversion, each of which leaves a tenth


def with_bodies(catalogue: StarCatalogue, bodies: dict[int, Body], meter: Meter) -> StarCatalogue:
    """The star list with the points of light behind its stars; ``bodies`` by number."""
    points = {number: body for number, body in bodies.items() if not body.radius_rad}
    if not points:
        return catalogue
    meter.charge(flash_read=3 * len(points), ram_write=3 * len(points), loop=len(points))
    places = np.stack([body.direction for body in points.values()])
    return replace(
        catalogue,
        vectors=np.concatenate([catalogue.vectors, places]),
        hip=np.concatenate([catalogue.hip, [FIRST_BODY + number for number in points]]),
        v_mag=np.concatenate([catalogue.v_mag, np.full(len(points), np.nan)]),
    )


def accuracies(known: StarCatalogue, bodies: dict[int, Body]) -> NDArray[np.float32]:
    """Standard deviation (n,) of each direction of the list in rad; 0 for a star."""
    found = [bodies[int(number) - FIRST_BODY].accuracy_rad for number in _bodies_of(known)]
    return np.concatenate(
        [np.zeros(len(known) - len(found), np.float32), np.array(found, np.float32)]
    )


def _bodies_of(known: StarCatalogue) -> NDArray[np.int64]:
    return known.hip[known.hip >= FIRST_BODY]


def usable(identification: Identification, accuracy: NDArray[np.float32]) -> Identification:
    """Without the bodies that are not known well enough for an attitude."""
    stars = identification.stars
    poor = (stars != NONE) & (accuracy[stars] > GOOD_RAD)
    return (
        replace(identification, stars=np.where(poor, NONE, stars)) if poor.any() else identification
    )


def summary(
    frame: int, bodies: dict[int, Body], known: StarCatalogue, identification: Identification | None
) -> dict[str, Value]:
    """Values of telemetry Bodies, without the Moon's."""
    values: dict[str, Value] = {"FrameCounter": frame, "Listed": len(bodies)}
    if identification is not None:
        named = identification.stars[identification.matched]
        accuracy = accuracies(known, bodies)[named]
        are_bodies = known.hip[named] >= FIRST_BODY
        values["Named"] = int(np.count_nonzero(are_bodies))
        values["Used"] = int(np.count_nonzero(are_bodies & (accuracy <= GOOD_RAD)))
    return values


def beside(disc: SeenDisc, results: Results, meter: Meter) -> Results:
    """``results`` without the centroids of the disc and its glare."""
    detection = results.detection
    assert detection is not None, "identified before anything was detected"
    apart = detection.centroids - np.array([disc.x, disc.y], np.float32)
    kept = np.flatnonzero(np.hypot(*apart.T) > GLARE * disc.radius_px + GLARE_PX)
    count = len(apart)
    meter.charge(f32_mul=2 * count, f32_add=3 * count, f32_compare=count, loop=count)
    known = len(detection.errors_px)
    return replace(
        results,
        detection=replace(
            detection,
            centroids=detection.centroids[kept],
            sizes=detection.sizes[kept],
            intensities=detection.intensities[kept],
            errors_px=detection.errors_px[kept] if known else detection.errors_px,
        ),
        points=results.points[kept],
        vectors=results.vectors[kept],
    )


def disc_values(disc: SeenDisc | None) -> dict[str, Value]:
    """Values of telemetry Bodies before there is an attitude."""
    if disc is None:
        return {"Disc": Disc.NOT_SEEN}
    return {"Disc": Disc.SEEN, "DiscSamples": disc.samples, "DiscX": disc.x, "DiscY": disc.y}


def check_disc(
    disc: SeenDisc | None,
    body: Body,
    rotation: NDArray[np.float32],
    camera: CameraParameters,
    meter: Meter,
) -> dict[str, Value]:
    """Values of telemetry Bodies: the disc beside where an attitude (3, 3), inertial to camera,
    puts the Moon. One that is cut by the image's edge confirms nothing."""
    there = turned(body.direction[None], rotation)[0]
    meter.charge(f32_mul=9, f32_add=6, f32_compare=1)
    if disc is None:
        ahead = there[2] > np.float32(0.5)
        expected = ahead and is_inside(*_pixel(there, camera, meter))
        return {"Disc": Disc.ABSENT if expected else Disc.NOT_SEEN}
    place = np.array([[disc.x, disc.y]], np.float32)
    seen = unit_vectors(undistort(place, camera, meter), camera, meter)[0]
    apart = float(np.linalg.norm(seen - there))
    meter.charge(f32_mul=3, f32_add=5, f32_sqrt=1, f32_compare=1)
    margin = body.radius_rad + DISC_MARGIN_RAD
    near = Disc.CONFIRMED
    if not disc.is_whole:  # its middle may be outside
        near, margin = Disc.SEEN, margin + 2 * LARGEST_PX * camera.pitch_mm / camera.focal_length_mm
    where = near if apart <= margin else Disc.MISPLACED
    return disc_values(disc) | {"DiscApart": apart, "Disc": where}


def _pixel(
    direction: NDArray[np.float32], camera: CameraParameters, meter: Meter
) -> tuple[float, float]:
    """Pixel at which a direction (3,) in camera axes is seen, with distortion."""
    scale = np.float32(camera.focal_length_mm / camera.pitch_mm)
    ideal = np.array([[camera.cx, camera.cy]], np.float32) + scale * direction[:2] / direction[2]
    place = ideal
    for _ in range(_ROUNDS):
        place = place + ideal - undistort(place, camera, meter)
    meter.charge(f32_mul=2, f32_div=2, f32_add=2 + 4 * _ROUNDS)
    return float(place[0, 0]), float(place[0, 1])
