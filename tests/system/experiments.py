"""Experiments behind docs/fidelity.md and profiles.md that `cubestack measure` has no options for.

Each runs the whole stack, reads the serial line and prints what it found::

    .venv/bin/python tests/system/experiments.py field          tables 4.4 and 4.5
    .venv/bin/python tests/system/experiments.py margins        the same, stars alone, by tolerance
    .venv/bin/python tests/system/experiments.py pairs          two pair limits beside each other
    .venv/bin/python tests/system/experiments.py thresholds     the uncut sky
    .venv/bin/python tests/system/experiments.py times          figure 5.7
    .venv/bin/python tests/system/experiments.py slew           section 6.2, lost in space
    .venv/bin/python tests/system/experiments.py loop           table 6.2
"""

import argparse
import math
from collections import defaultdict
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.boards.cubestar.catalogue import PAIR_LIMIT_DEG, onboard_catalogue
from cubestack.emulator.boards.cubestar.power import CUBESTAR_POWER
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.scene.attitude import matrix_from_quaternion, random_quaternion
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.cubestar.matching.voting import identify
from cubestack.firmware_model.interface.cubestar import INTERFACE, IdMode
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.node import NodeClient
from cubestack.host.experiments.attitude import errors, is_right, rough_boresight
from cubestack.host.experiments.cubestar.measure import give_hint

PUBLISHED_PAIR_LIMIT_DEG = 42.1
EXTENDED = CubeStarSwitches.of("extended")

#: The field of table 4.4: 54 x 28 degrees, no distortion.
PX = 512 / math.tan(math.radians(27))
CENTRED = {"cx": 511.5, "cy": 255.5, "k1": 0, "k2": 0, "p1": 0, "p2": 0}
PLAIN = replace(LENS, focal_length_mm=PX * 0.0056, fx=PX, fy=PX, **CENTRED)
PLAIN_SETTINGS = {
    "setFocalLength": {"FocalLength": PLAIN.focal_length_mm},
    "setFocalLengthComponents": {"Fx": PLAIN.fx, "Fy": PLAIN.fy},
    "setPrincipalPoint": {"Cx": PLAIN.cx, "Cy": PLAIN.cy},
    "setRadialDistortionGains": {"K1": 0.0, "K2": 0.0},
    "setTangentalDistortionGains": {"P1": 0.0, "P2": 0.0},
}


@dataclass
class Shot:
    """One picture as the host saw it; errors in degrees, from the truth."""

    valid: bool
    right: bool
    detected: int
    matched: int
    cross: float
    roll: float
    phases: dict[str, float]


class Stack:
    """A board with a client on its serial line."""

    def __init__(
        self,
        pair_limit_deg: float = PAIR_LIMIT_DEG,
        optics: Optics = LENS,
        switches: CubeStarSwitches = EXTENDED,
    ) -> None:
        catalogue = onboard_catalogue(pair_limit_deg=pair_limit_deg)
        self.board = CubeStarBoard(SkyScene.pointing(0, 0), catalogue, switches=switches)
        self.cubestar = CubeStar(NodeClient(self.board.serial(), INTERFACE))
        self.optics = optics
        if optics is not LENS:
            self.cubestar.configure(PLAIN_SETTINGS)

    def close(self) -> None:
        self.board.close()

    def shoot(self, hint: "tuple[float, np.random.Generator] | None" = None, **scene: Any) -> Shot:
        """Capture and process; ``hint`` tells a boresight that is at most so many degrees off."""
        sky = SkyScene(**scene)
        condition = replace(CONDITION, optics=self.optics, seed=sky.seed)
        self.board.camera.scene = SkyView(sky, condition)
        client = self.cubestar.client
        client.command("setIDMode", IdMode=IdMode.TRACKING if hint else IdMode.LOST_IN_SPACE)
        if hint is not None:
            give_hint(self.cubestar, rough_boresight(sky.truth(0), *hint))
        self.cubestar.capture_and_process()
        attitude, phases = self.cubestar.attitude(), self.cubestar.phase_times()
        truth = self.board.truth()
        assert truth is not None
        cross, roll = errors(attitude.quaternion, truth)
        detected = int(client.telemetry("DetectionSummary")["NumStarsDetected"])
        matched = attitude.matched if attitude.valid else 0
        right = attitude.valid and is_right(cross, roll)
        return Shot(attitude.valid, right, detected, matched, cross, roll, phases)

    def print_rates(self, frames: int, title: str, *modes: str, **scene: Any) -> None:
        """Percentages over random poses; the same ones in every mode."""
        for mode in modes:
            rng, error_deg = np.random.default_rng(1), MODES[mode]
            hint = None if error_deg is None else (error_deg, rng)
            shots = [
                self.shoot(hint, quaternion=random_quaternion(rng), seed=number, **scene)
                for number in range(frames)
            ]
            wrong = sum(shot.valid and not shot.right for shot in shots)
            print(
                f"{title}, {mode}: {percent(shots, 'right')} right, {wrong} wrong, "
                f"{matched_share(shots)}",
                flush=True,
            )


def percent(shots: list[Shot], key: str) -> str:
    return f"{100 * np.mean([getattr(shot, key) for shot in shots]):5.1f} %"


def matched_share(shots: list[Shot]) -> str:
    share = 100 * sum(shot.matched for shot in shots) / sum(shot.detected for shot in shots)
    return f"{share:5.1f} % of the detected stars matched"


LOST, ROUGH, EXACT = "lost in space", "assisted 5 deg", "assisted exact"
MODES = {LOST: None, ROUGH: 5.0, EXACT: 0.0}


def field(frames: int) -> None:
    """Tables 4.4 and 4.5."""
    for limit in (PUBLISHED_PAIR_LIMIT_DEG, PAIR_LIMIT_DEG):
        with closing(Stack(limit, optics=PLAIN)) as stack:
            for magnitude in (3.6, 3.7, 3.8):
                title = f"pairs {limit} deg, V < {magnitude}"
                stack.print_rates(frames, title, *MODES, mag_limit=magnitude)
            for false in (1, 5, 10):
                title = f"pairs {limit} deg, {false} false stars"
                stack.print_rates(frames, title, LOST, ROUGH, mag_limit=3.8, false_stars=false)


def centroids_alone(rng: Any, v: float, false: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """A random picture of the published field as unit vectors (n, 3), the first 20 from the top on,
    0.03 px off, and their stars' places in the list, -1 for false ones."""
    catalogue = onboard_catalogue(pair_limit_deg=PUBLISHED_PAIR_LIMIT_DEG)
    rays = catalogue.vectors @ matrix_from_quaternion(random_quaternion(rng)).T
    places = PX * rays[:, :2] / np.where(rays[:, 2:] > 0, rays[:, 2:], np.nan)
    seen = np.flatnonzero((np.abs(places) < [512, 256]).all(axis=1) & (catalogue.v_mag < v))
    lights = rng.uniform([-512, -256], [512, 256], (false, 2))
    points = np.concatenate([places[seen] + 0.03 * rng.standard_normal((len(seen), 2)), lights])
    order = np.argsort(points[:, 1])[:20]
    rays = np.column_stack([points, np.full(len(points), PX)])[order]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return rays.astype(np.float32), np.append(seen, np.full(false, -1))[order]


def margins(frames: int) -> None:
    """Algorithm 2 as printed, stars alone, by its search tolerance: percent of pictures with three
    stars right, with one wrong, and of the listed stars in a picture those that are right."""
    catalogue = onboard_catalogue(pair_limit_deg=PUBLISHED_PAIR_LIMIT_DEG)
    for v, false in ((3.6, 0), (3.7, 0), (3.8, 0), (3.8, 1), (3.8, 5), (3.8, 10)):
        cells = []
        for margin_rad in (0.001, 0.0015, 0.002):
            rng, rows = np.random.default_rng(1), []
            for _ in range(frames):
                rays, stars = centroids_alone(rng, v, false)
                meter = Meter(CORTEX_M3)
                found = identify(rays, catalogue, meter, margin_rad=margin_rad, printed=True)
                named = found.stars[found.matched] == stars[found.matched]
                listed = max(1, np.count_nonzero(stars >= 0))
                rows.append((named.sum() > 2, not named.all(), named.sum() / listed))
            cells += [f"{100 * part:.1f}" for part in np.mean(rows, axis=0)]
        print(f"| V < {v}, {false} false |", " | ".join(cells), "|", flush=True)


def pairs(frames: int) -> None:
    """The default lens, with two catalogues."""
    for limit in (PUBLISHED_PAIR_LIMIT_DEG, PAIR_LIMIT_DEG):
        with closing(Stack(limit)) as stack:
            stack.print_rates(frames, f"pairs {limit} deg", LOST, ROUGH, mag_limit=3.8)


def times(frames: int) -> None:
    """Figure 5.7: detection and matching, by the number of centroids."""
    rng = np.random.default_rng(1)
    by_count: dict[int, list[dict[str, float]]] = defaultdict(list)
    with closing(Stack()) as stack:
        for number in range(frames):
            shot = stack.shoot(quaternion=random_quaternion(rng), seed=number, mag_limit=3.8)
            by_count[shot.detected].append(shot.phases)
    for count, phases in sorted(by_count.items()):
        detect, match, attitude = (
            np.array([phase[name] for phase in phases]) for name in ("detect", "match", "attitude")
        )
        print(
            f"{count:2} centroids ({len(phases):3} pictures): detection {detect.mean():5.1f}, "
            f"matching {match.mean():5.1f}, both {np.mean(detect + match):5.1f} and at most "
            f"{np.max(detect + match):5.1f}, attitude {attitude.mean():4.2f} ms"
        )


def thresholds(frames: int) -> None:
    """All stars that the camera sees, with higher detection thresholds."""
    with closing(Stack()) as stack:
        for threshold in (6, 8, 10, 13, 16, 20):
            stack.cubestar.client.command(
                "setDetectionThresholds", DetectionThreshold=threshold, StarThreshold=threshold
            )
            stack.print_rates(frames, f"threshold {threshold:2} DN", LOST, ROUGH)


def slew(frames: int) -> None:
    """Section 6.2, lost in space, body rates across the boresight."""
    for rate in (0.0, 0.1333, 0.3, 0.5, 1.0, 2.0, 4.0):
        rng = np.random.default_rng(1)
        with closing(Stack()) as stack:
            shots = []
            for number in range(frames):
                side = rng.uniform(0, 2 * math.pi)
                turning = (rate * math.cos(side), rate * math.sin(side), 0.0)
                pose = random_quaternion(rng)
                shots.append(
                    stack.shoot(quaternion=pose, rate_deg_s=turning, seed=number, mag_limit=3.8)
                )
        cross = [shot.cross for shot in shots if shot.right] or [math.nan]
        print(
            f"{rate} deg/s: {percent(shots, 'valid')} solved, {percent(shots, 'right')} right, "
            f"{matched_share(shots)}, median error {np.median(cross):.4f} deg across",
            flush=True,
        )


def loop(frames: int) -> None:
    """Table 6.2: phases and mean power of the 1 Hz loop."""
    with closing(Stack()) as stack:
        client, board = stack.cubestar.client, stack.board
        board.camera.scene = SkyScene.pointing(84, -1)
        client.command("Trigger")
        rows = []
        for turn in range(frames + 3):
            if turn == 3:
                started, charge = board.kernel.now, board.power.charge_mas()
            due = board.kernel.now + PS_PER_S
            while board.kernel.now < due:
                client.pause((due - board.kernel.now) / PS_PER_S)
            if turn >= 3:
                rows.append(stack.cubestar.phase_times())
        seconds = (board.kernel.now - started) / PS_PER_S
        power = (board.power.charge_mas() - charge) * CUBESTAR_POWER.volts / seconds
    for name in rows[0]:
        print(f"{name}: {np.mean([row[name] for row in rows]):.1f} ms")
    print(f"mean power {power:.1f} mW over {seconds:.0f} s")


EXPERIMENTS = {
    experiment.__name__: experiment
    for experiment in (field, margins, pairs, thresholds, times, slew, loop)
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=EXPERIMENTS)
    parser.add_argument("--frames", type=int, default=200, help="frames of each line")
    args = parser.parse_args()
    EXPERIMENTS[args.name](args.frames)


if __name__ == "__main__":
    main()
