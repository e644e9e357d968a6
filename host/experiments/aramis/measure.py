"""Measure attitudes with AraMiS' star tracker end to end: scene, camera, firmware,
serial line, host.

The star tracker captures and processes every picture; the host sees only what
comes back over the serial line. Only this command has the truth; it prints it
beside the result. The sky shows all stars that the camera can see. The
first measurement with a lens compiles its catalogue, which takes seconds.

examples:
  cubestack measure aramis --frames 20                       lost in space
  cubestack measure aramis --frames 200 --json > frames.jsonl
  cubestack measure aramis --mode assisted --hint-error 3    rough boresight
  cubestack measure aramis --profile extended --frames 100   what is believed is confirmed
  cubestack measure aramis --field 18 --roll-rate 10 --exposure 20
  cubestack measure aramis --bit-flips 1e-6                  upsets in flash
  cubestack measure aramis --ram-flips 1e-7 --set ram=coded  upsets in RAM
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.aramis.board import AramisBoard
from cubestack.emulator.boards.aramis.catalogue import onboard_database
from cubestack.emulator.camera.common.scene_file import load_scene
from cubestack.emulator.camera.common.view import SkyCondition, SkyView, View
from cubestack.emulator.camera.mt9m001.imager import NoiseTerms
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.scene.attitude import matrix_from_quaternion
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.emulator.scene.sky import PictureScene, SkyScene
from cubestack.firmware_model.interface.aramis import OnOff
from cubestack.firmware_model.interface.cameras import mt9m001
from cubestack.firmware_model.values import REQUIRED, choice, many, number, positive, vector
from cubestack.host.clients.aramis.client import Aramis, Star
from cubestack.host.emulation.emulated import EmulatedDevice
from cubestack.host.experiments import attitude as attitudes
from cubestack.host.experiments import hazard_options as hazards
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import corner

AramisOpener: TypeAlias = "Opener[AramisBoard, Aramis]"
_Emulated: TypeAlias = "EmulatedDevice[AramisBoard, Aramis]"

FIELD_DEG = 21.53463888888889
"""Field of the published simulations; the lens to be built was expected to have 18."""

NOISE_TERMS = ("shot", "dark", "background", "quantisation", "readout")
ROW_CLOCKS = mt9m001.COLUMNS + mt9m001.FRAME_START_CLOCKS + mt9m001.FRAME_END_CLOCKS
ROW_S = ROW_CLOCKS / mt9m001.PIXEL_CLOCK_HZ
PHASE_S = 0.2
"""Measurements start at a random time within this many s of each other."""


def _rising(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] <= pair[1]:
        raise ValueError(f"must have the brightest first, not {pair}")
    return pair


@dataclass(frozen=True, kw_only=True)
class AramisOptions(attitudes.SkyOptions):
    """Options of `cubestack measure aramis`."""

    mode: str = choice(
        "lis", "lost in space (default), or near a rough direction", ("lis", "assisted")
    )
    field: float = number(
        FIELD_DEG,
        "field of view of lens and catalogue (default 21.5346, the published one)",
        5,
        40,
        "deg",
    )
    exposure: float | None = positive(None, "exposure (default 200)", unit="ms")
    gain: float | None = number(None, "gain, 1 to 15 (default 15)", 1, 15, metavar="X")
    rate: float = number(0.0, "body rate across the boresight", 0, 180, "deg/s")
    roll_rate: float = number(0.0, "body rate about it", 0, 180, "deg/s")
    false_mags: tuple[float, float] = vector(
        2,
        (4.5, 6.0),
        "brightest and faintest magnitude of the false stars (default 4.5,6)",
        make=_rising,
        metavar="V,V",
    )
    without: tuple[str, ...] = many(
        (), "leave out a term of the noise; repeatable", choice(REQUIRED, "", NOISE_TERMS)
    )
    bit_flips: float = number(
        0.0,
        "flip each bit of the catalogue's flash with this probability before each frame",
        0,
        1,
        metavar="RATE",
    )
    ram_flips: float = number(
        0.0,
        "flip each bit of the SDRAM, which holds the catalogue, with this probability before each "
        "frame",
        0,
        1,
        metavar="RATE",
    )
    crop: tuple[int, int] = corner(
        (0, 0), "with --image: left upper corner of the 1280 x 1024 part"
    )

    def check(self) -> None:
        """Options for images need --image; options for random skies exclude --scene and --image."""
        if self.image is None and self.given("crop"):
            raise ValueError("--crop belongs to --image")
        hazards.check(self.hazard)
        sky = ("mag_limit", "false_stars", "no_noise", "hazard", "rate", "roll_rate")
        if not self.is_random and self.given(*sky):
            raise ValueError(
                "--mag-limit, --false-stars, --no-noise, --hazard and rates belong to the random "
                "sky; a scene file has keys for them"
            )


#: Keys of the JSON output, in their order.
_KEYS = (
    *("solved", "right", "outcome", "reason", "centroids", "matched", "wrong"),
    *("candidates", "pivots", "triples", "mode", "error_cross_deg", "error_roll_deg"),
    *("false_alarm", "sigma_deg", "error_deg"),
    *("far", "truth", "quaternion", "image_time_s", "flips", "corrected", "lost"),
    *("phase_ms", "wall_ms", "status"),
)


@dataclass(frozen=True)
class AramisResult(attitudes.AttitudeResult):
    """Attributes are those of the JSON output."""

    outcome: str  #: how the identification ended
    #: candidates, pivots, triples: of the identification
    candidates: int
    pivots: int
    triples: int
    #: whether the middle of the triangle (the first three identified stars) is more than a field's
    #: diameter from the boresight, which appendix E counts as wrong; None without truth or triangle
    far: bool | None
    image_time_s: float  #: mid-exposure by the star tracker's clock, since power-up
    #: flips, corrected, lost: flipped bits in memories, and corrected and lost words on loading
    flips: int
    corrected: int
    lost: int

    @property
    def ending(self) -> str:
        return f"{self.outcome}: {self.reason} {self.status}".rstrip()

    def as_dict(self) -> dict[str, Any]:
        return {key: getattr(self, key) for key in _KEYS}


class _Experiment(attitudes.AttitudeExperiment["AramisOpener", AramisOptions, AramisResult]):
    options = AramisOptions
    description = __doc__

    def summarise(self, results: Sequence[AramisResult], wall_s: float) -> Iterator[str]:
        """The usual lines, and wrong results as the thesis counts them."""
        yield from super().summarise(results, wall_s)
        far = 100 * sum(bool(result.far) for result in results) / max(1, len(results))
        yield f"wrong by appendix E's criterion, a triangle more than a field away: {far:.1f} %"

    def run(self, opened: AramisOpener, options: AramisOptions) -> Iterator[AramisResult]:
        rng = np.random.default_rng(options.seed)
        condition = SkyCondition(double_gauss(options.field))
        with opened(
            _view(options, condition, rng),
            seed=options.seed,
            faults=options.faults,
            catalogue=onboard_database(options.field, opened.shown),
            noise=NoiseTerms(**dict.fromkeys(options.without, False)),
        ) as emulated:
            aramis = emulated.client
            _configure(aramis, options)
            aramis.activate()
            pristine = emulated.board.catalogue_flash.copy()
            for number in range(options.frames):
                if number and options.is_random:
                    emulated.scene = _view(options, condition, rng, emulated.time_s)
                flips = 0
                if options.bit_flips:
                    aramis.deactivate()
                    emulated.board.catalogue_flash[:] = pristine
                    flips = emulated.board.irradiate("flash", options.bit_flips)
                    aramis.activate()
                if options.ram_flips:
                    flips += emulated.board.irradiate("sdram", options.ram_flips)
                aramis.client.pause(float(rng.uniform(0, PHASE_S)))
                yield _measure(emulated, options, rng, flips, opened.rates)


def _view(
    options: AramisOptions, condition: SkyCondition, rng: np.random.Generator, time_s: float = 0.0
) -> SkyView:
    if isinstance(options.scene, Path):
        return load_scene(options.scene, condition)
    if isinstance(options.scene, View):
        return options.scene
    if options.scene is not None:
        return SkyView(options.scene, condition)
    if options.image is not None:
        return SkyView(PictureScene(options.image, crop=options.crop), condition)
    along = rng.random() * 2 * np.pi
    rate = (options.rate * np.cos(along), options.rate * np.sin(along), options.roll_rate)
    return attitudes.random_view(
        options, condition, rng, time_s, rate_deg_s=rate, false_star_mag=options.false_mags
    )


def _configure(aramis: Aramis, options: AramisOptions) -> None:
    client = aramis.client
    client.command("SetField", FieldOfView=options.field, Round=OnOff.ON)
    if options.exposure is not None:
        client.command("SetExposure", Rows=max(1, round(options.exposure / 1000 / ROW_S)))
    if options.gain is not None:
        client.command("SetGain", Gain=options.gain)
    client.wait_processed(1.0)


def _measure(
    emulated: _Emulated, options: AramisOptions, rng: np.random.Generator, flips: int, rates: bool
) -> AramisResult:
    started = time.perf_counter()
    aramis, client, board = emulated.client, emulated.client.client, emulated.board
    client.command("ClearErrorFlags")
    hint = None
    if options.mode == "assisted":
        known = emulated.scene.truth(board.kernel.now)
        if known is None:
            raise ValueError("--mode assisted needs a scene whose attitude is known")
        hint = attitudes.rough_boresight(known, options.hint_error, rng)
    found = aramis.measure(hint)
    truth = board.truth(found.frame)
    summary = client.telemetry("IdentificationSummary")
    catalogue = client.telemetry("CatalogueStatus")
    flags = client.telemetry("ErrorFlags")
    stars = aramis.stars() if found.valid and truth is not None else []
    named = [star for star in stars if star.hipparcos is not None]
    measured = found.quaternion if found.valid else None
    return AramisResult(
        **attitudes.compare(measured, truth),
        **attitudes.claims(aramis.quality() if rates else None, measured, truth),
        outcome=found.outcome.name.lower(),
        reason=found.reason.name.lower(),
        centroids=found.detected,
        matched=found.matched if found.valid else 0,
        wrong=_count_wrong(emulated, named, truth) if found.valid else 0,
        far=_is_far(named, options.field, truth),
        candidates=int(summary["Candidates"]),
        pivots=int(summary["Pivots"]),
        triples=int(summary["Triples"]),
        mode=options.mode,
        image_time_s=found.image_uptime_s,
        flips=flips,
        corrected=int(catalogue["Corrected"]),
        lost=int(catalogue["Lost"]),
        phase_ms=aramis.phase_times(),
        wall_ms=1000 * (time.perf_counter() - started),
        status=" ".join(name for name, up in flags.items() if up),
    )


def _count_wrong(
    emulated: _Emulated, named: Sequence[Star], truth: NDArray[np.float64] | None
) -> int | None:
    """Number of wrongly identified stars; None without a truth."""
    camera = emulated.board.camera
    if truth is None or not isinstance(camera.scene, SkyScene):
        return None
    places = np.array([[star.x_px, star.y_px] for star in named]).reshape(-1, 2)
    hipparcos = [star.hipparcos or 0 for star in named]
    return attitudes.count_wrong(hipparcos, camera.condition.optics.unproject(places), truth)


def _is_far(
    named: Sequence[Star], field_deg: float, truth: NDArray[np.float64] | None
) -> bool | None:
    """Appendix E's criterion of a wrong result; None if it cannot be evaluated."""
    triangle = np.array([star.hipparcos or 0 for star in named[:3]], np.int32)
    if truth is None or len(triangle) < 3:
        return None
    sky = load_sky()
    middle = sky.vectors[np.searchsorted(sky.hip, triangle)].mean(axis=0)
    cosine = middle @ matrix_from_quaternion(truth)[2] / np.linalg.norm(middle)
    return bool(cosine < np.cos(np.radians(field_deg)))


EXPERIMENT = _Experiment()
