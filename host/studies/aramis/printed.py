"""Trials of what AraMiS' thesis prints twice: removal of spikes, and the variance of an angle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.aramis.catalogue import onboard_database
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.scene.attitude import matrix_from_quaternion, random_quaternion
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.aramis.detection.mask import WINDOW, LevelHistory, SpikeRemoval
from cubestack.firmware_model.aramis.field import FOV_DEG, CameraField
from cubestack.firmware_model.aramis.matching.triangles import measure_triangle
from cubestack.firmware_model.aramis.matching.triples import find_triangles
from cubestack.firmware_model.aramis.pipeline import DetectionSettings, detect
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.experiments.aramis.measure import AramisOpener
from cubestack.host.studies.rows.estimate import average, rate
from cubestack.host.studies.rows.trial import Figures

SEED = 1
BRIGHT = 5.0  #: stars of lower V should be found
NEAR_PX = 3.0  #: of a star, to be that star
FAINTEST = 8.0  #: V of a star that can be a spot

#: Variances of an angle in the listing of appendix E, as standard deviations in px of 582: of its
#: last run, of the remark "best one so far", of two lines that are no longer run.
VARIANCES = {"run": 0.26, "noted": 0.13, "older": 0.17, "fixed": (5.3291e-15**0.5) * 582 / 0.3759}
SIMULATOR_PX = 582
SENSOR_PX, SENSOR_NOISE_PX = 1024, 0.1


@dataclass(frozen=True)
class _Found:
    """What a method leaves of one picture."""

    bright: list[bool]  #: for each bright star, whether it was found
    false: int  #: spots where no star is
    cycles: int


def spikes(opened: AramisOpener, frames: int) -> Figures:
    """Bright stars found in percent, false spots per picture, and ms, for each method.

    `printed_ms` is method 1 as the text has it, reading all pixels of each window.
    """
    rng, field = np.random.default_rng(SEED), CameraField()
    condition = SkyCondition(double_gauss(FOV_DEG))
    past = {method: LevelHistory() for method in SpikeRemoval}
    found: dict[SpikeRemoval, list[_Found]] = {method: [] for method in SpikeRemoval}
    with opened(_view(condition, rng), seed=SEED) as emulated:
        emulated.client.activate()
        for number in range(frames):
            emulated.scene = _view(condition, rng)
            emulated.client.measure()
            picture = list(emulated.board.pictures().values())[number % 2]
            truth = emulated.board.truth()
            assert truth is not None
            stars = _stars(emulated.board.camera.condition.optics, truth, field)
            for method in SpikeRemoval:
                one = _found(picture, past[method], method, field, stars)
                found[method].append(one)
    figures: dict[str, float] = {}
    for method, all_of_it in found.items():
        name = method.name.lower()
        figures[f"{name}_bright"] = rate(star for one in all_of_it for star in one.bright)
        figures[f"{name}_false"] = average(float(one.false) for one in all_of_it)
        figures[f"{name}_ms"] = _ms(float(np.mean([one.cycles for one in all_of_it])))
    costs, reads = BLACKFIN_BF533.operations, WINDOW**2 * field.rows * field.columns
    each = sum(costs[name].cycles for name in ("table_byte", "i32_add", "loop"))
    return {**figures, "printed_ms": _ms(reads * each)}


def _view(condition: SkyCondition, rng: np.random.Generator) -> SkyView:
    return SkyView(SkyScene(random_quaternion(rng)), condition)


def _stars(
    optics: Optics, truth: NDArray[np.float64], field: CameraField
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Places (n, 2) of stars in the field, and which are bright."""
    sky = load_sky(mag_limit=FAINTEST)
    camera = sky.vectors @ matrix_from_quaternion(truth).T
    ahead = camera[:, 2] > float(field.smallest_cosine)
    places = optics.project(camera[ahead])
    inside = field.inside(places.astype(np.float32), Meter(BLACKFIN_BF533))
    return places[inside], (sky.v_mag[ahead] < BRIGHT)[inside]


def _found(
    picture: NDArray[np.uint8],
    past: LevelHistory,
    method: SpikeRemoval,
    field: CameraField,
    stars: tuple[NDArray[np.float64], NDArray[np.bool_]],
) -> _Found:
    meter, (places, bright) = Meter(BLACKFIN_BF533), stars
    settings = DetectionSettings(spikes=method, max_stars=255)
    spots = detect(picture, past, field, settings, meter)
    centroids = np.zeros((0, 2)) if spots is None else spots.centroids
    apart = np.linalg.norm(centroids[:, None] - places[None], axis=2)
    near = apart < NEAR_PX
    return _Found(
        near.any(axis=0)[bright].tolist(),
        int((~near.any(axis=1)).sum()),
        meter.phases.get("spikes", 0),
    )


def _ms(cycles: float) -> float:
    return 1000 * cycles / BLACKFIN_BF533.clock_hz


def bounds(_opened: AramisOpener, frames: int) -> Figures:
    """Triangles within three sigma, and in percent whether the right one is among them.

    For each of `VARIANCES`, with this sensor's noise and with the noise of the last run. The three
    brightest stars of random fields, if the catalogue has their triangle.
    """
    rng, meter, database = np.random.default_rng(SEED), Meter(BLACKFIN_BF533), onboard_database()
    sky = load_sky(mag_limit=6.0)
    known = {tuple(three): at for at, three in enumerate(database.stars.tolist())}
    index = {number: at for at, number in enumerate(database.numbers.tolist())}
    noises = {"sensor": SENSOR_NOISE_PX / SENSOR_PX, "run": VARIANCES["run"] / SIMULATOR_PX}
    counts: dict[str, list[int]] = {name: [] for name in VARIANCES}
    right: dict[str, list[bool]] = {f"{n}_{v}": [] for n in noises for v in VARIANCES}
    while len(counts["run"]) < frames:
        boresight = rng.normal(size=3)
        near = sky.vectors @ boresight / np.linalg.norm(boresight)
        seen = np.flatnonzero(near > np.cos(np.radians(database.fov_deg / 2)))
        seen = seen[np.argsort(sky.v_mag[seen])[:3]]
        three = tuple(sorted(index.get(hip, -1) for hip in sky.hip[seen].tolist()))
        if three not in known:
            continue
        shift = rng.normal(size=(3, 3))
        for noise, share in noises.items():
            vectors = sky.vectors[seen] + shift * share * np.radians(database.fov_deg)
            vectors /= np.linalg.norm(vectors, axis=1)[:, None]
            for name, sigma_px in VARIANCES.items():
                sigma_rad = sigma_px / SIMULATOR_PX * np.radians(database.fov_deg)
                triangle = measure_triangle(vectors.astype(np.float32), sigma_rad, meter)
                assert triangle is not None, "stars of the catalogue are not on a line"
                found = find_triangles(triangle, database, None, meter).tolist()
                right[f"{noise}_{name}"].append(known[three] in found)
                if noise == "sensor":
                    counts[name].append(len(found))
    return {name: average(values) for name, values in counts.items()} | {
        name: rate(values) for name, values in right.items()
    }
