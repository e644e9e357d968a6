"""A closed attitude loop: a 3U satellite with emulated sensors and no gyroscope.

python attitude_loop.py [star-tracker|sun-earth|both] [--faults]. Every two seconds the program
turns the sensors with the satellite, collects their measurements, corrects its estimate of attitude
and rate, and sets the torque of the wheels. With --faults the star tracker has a latch-up during
the exposure at 60 s, and from 120 s to 140 s the Moon in the field of its dusty lens.
"""

import argparse
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import cubestack
from cubestack.emulator.scene.attitude import (
    matrix_from_quaternion,
    propagate,
    quaternion_from_matrix,
)
from cubestack.emulator.scene.earth_sun import Mounting
from cubestack.emulator.scene.hazards.moon import Moon
from cubestack.emulator.scene.orbit import rate_between
from cubestack.sampling import AttitudeSampler, DirectionSampler, Sample

Vector = NDArray[np.float64]

STEP_S = 2.0  # between measurements of the star tracker
PART_S = 0.1  # of the integration
INERTIA = np.diag([0.035, 0.035, 0.007])  # kg m2
TORQUE_N_M = 5e-4  # largest of the wheels
STIFFNESS, DAMPING = 0.008, 0.16  # rad/s2 per rad, and per rad/s
FINE, COARSE = (0.8, 0.4), (0.3, 0.05)  # gains of the estimate: star tracker, Sun and Earth

WANTED = matrix_from_quaternion([0.1, 0.7, 0.2, 0.68])  # inertial to body
START_DEG, START_DEG_S = (3.0, -1.5, 1.0), (0.05, -0.03, 0.1)
TRACKER = Mounting((0.0, -0.8, -0.6)).matrix  # body axes to those of its camera
SUN = WANTED.T @ np.array([0.3, 0.8, -0.52])
ORBIT_DEG_S, ALTITUDE_KM = 0.0634, 500.0

BOTH = ("star-tracker", "sun-earth")
SLOW_S = {("sun-earth",): 4.0, BOTH: 8.0}  # between measurements of Sun and Earth
LATCH_UP, MOON_S = ["latch-up", "imager", "at_s=60.2"], (120.0, 140.0)
DUSTY = Moon(scatter=0.2)  # a clean lens with 0.01 keeps its fixes


@dataclass(frozen=True)
class Row:
    """A step: time, true angle from the wanted attitude, and what the sensors said."""

    time_s: float
    error_deg: float
    star: Sample | None
    sun: Sample | None
    earth: Sample | None


class Estimator:
    """Attitude (3, 3), inertial to body, and rate in deg/s from fixes that are some seconds old."""

    def __init__(self) -> None:
        self.attitude: Vector | None = None
        self.rate = np.zeros(3)
        self._past: deque[tuple[float, Vector]] = deque(maxlen=100)
        self._latest_s = 0.0

    def predict(self, now_s: float, seconds: float, torque: Vector) -> None:
        """Go on by ``seconds`` to ``now_s``, under a torque in N m, body axes."""
        if self.attitude is not None:
            self.attitude, self.rate = turn(self.attitude, self.rate, torque, seconds)
            self._past.append((now_s, self.attitude))

    def correct(self, time_s: float, measured: Vector, gains: tuple[float, float]) -> None:
        """Use a fix of the time ``time_s``."""
        if self.attitude is None:
            self.attitude = measured
        else:
            then = min(self._past, key=lambda one: abs(one[0] - time_s), default=(0, self.attitude))
            moved = matrix_from_quaternion(
                propagate(quaternion_from_matrix(then[1]), self.rate, time_s - then[0])
            )
            off = rate_between(moved, measured, 1.0)
            attitude = propagate(quaternion_from_matrix(self.attitude), gains[0] * off, 1.0)
            self.attitude = matrix_from_quaternion(attitude)
            self.rate = self.rate + gains[1] * off / max(time_s - self._latest_s, STEP_S)
        self._latest_s = time_s

    def torque(self) -> Vector:
        """Of the wheels, in N m: a spring to the wanted attitude, and a damper."""
        if self.attitude is None:
            return np.zeros(3)
        off = np.radians(rate_between(self.attitude, WANTED, 1.0))
        wanted = INERTIA @ (STIFFNESS * off - DAMPING * np.radians(self.rate))
        return np.clip(wanted, -TORQUE_N_M, TORQUE_N_M)


def turn(attitude: Vector, rate: Vector, torque: Vector, seconds: float) -> tuple[Vector, Vector]:
    """A rigid body's attitude (3, 3) and rate in deg/s after a time."""
    spin = np.radians(rate)
    spin = spin + np.linalg.solve(INERTIA, torque - np.cross(spin, INERTIA @ spin)) * seconds
    middle = (rate + np.degrees(spin)) / 2
    turned = propagate(quaternion_from_matrix(attitude), middle, seconds)
    return matrix_from_quaternion(turned), np.degrees(spin)


def attitude_from_directions(sun: Vector, earth: Vector, nadir: Vector) -> Vector:
    """Inertial to body (3, 3) from the Sun and the Earth in body axes; the Sun counts fully."""

    def axes(first: Vector, second: Vector) -> Vector:
        first, across = first / np.linalg.norm(first), np.cross(first, second)
        across = across / np.linalg.norm(across)
        return np.array([first, across, np.cross(first, across)])

    return axes(sun, earth).T @ axes(SUN, nadir)


def nadir_at(time_s: float) -> Vector:
    """Direction of the Earth, inertial axes: it passes body z in the middle of the run."""
    angle = np.radians(ORBIT_DEG_S * (time_s - 100.0))
    return WANTED.T @ np.array([np.sin(angle), 0.0, np.cos(angle)])


def moon_at(time_s: float) -> Vector:
    """Direction of the Moon: 3 deg from the star tracker's boresight for a while, else behind."""
    if not MOON_S[0] <= time_s < MOON_S[1]:
        return -(WANTED.T @ TRACKER.T[:, 2])
    return WANTED.T @ TRACKER.T @ np.array([0.03, 0.04, 1.0])


def loop(
    sensors: tuple[str, ...] = BOTH, faults: bool = False, until_s: float = 200.0, seed: int = 0
) -> Iterator[Row]:
    """Run the loop; yields each step."""
    start = propagate(quaternion_from_matrix(WANTED), START_DEG, 1.0)
    attitude, rate, torque = matrix_from_quaternion(start), np.array(START_DEG_S), np.zeros(3)
    estimate = Estimator()
    with ExitStack() as stack:
        sky = cubestack.SkyScene(start, hazards=(DUSTY,) if faults else ())
        star, sense = (
            stack.enter_context(cubestack.open_device(name, scene, seed=seed, profile="extended"))
            for name, scene in (("cubestar", sky), ("cubesense", None))
        )
        tracker = AttitudeSampler(star)
        cameras = [DirectionSampler(sense, "sun"), DirectionSampler(sense, "nadir")]
        if faults:
            star.faults.inject_words(LATCH_UP)
        for time_s in np.arange(0.0, until_s + STEP_S / 2, STEP_S).tolist():
            moon = {"moon": moon_at(time_s)} if faults else {}
            body = quaternion_from_matrix(attitude)
            seen, found = None, [None, None]
            if "star-tracker" in sensors:
                camera = quaternion_from_matrix(TRACKER @ attitude)
                seen = tracker.step(time_s, camera, TRACKER @ rate, **moon)
            if "sun-earth" in sensors and time_s % SLOW_S[sensors] == 0:
                bodies = {"sun": SUN, "nadir": nadir_at(time_s), "altitude_km": ALTITUDE_KM}
                found = [one.step(time_s, body, rate, **bodies) for one in cameras]
            use(estimate, seen, found)
            yield Row(time_s, off_deg(attitude), seen, *found)
            torque = estimate.torque()
            for part in range(1, round(STEP_S / PART_S) + 1):
                attitude, rate = turn(attitude, rate, torque, PART_S)
                estimate.predict(time_s + part * PART_S, PART_S, torque)


def use(estimate: Estimator, seen: Sample | None, found: list[Sample | None]) -> None:
    """Correct the estimate: by the star tracker if it has a fix, else by Sun and Earth."""
    sun, earth = found
    if seen is not None and seen.value is not None:
        measured = TRACKER.T @ matrix_from_quaternion(seen.value)
        estimate.correct(seen.time_s, measured, FINE)
    elif sun and earth and sun.value is not None and earth.value is not None:
        nadir = nadir_at(earth.time_s)
        measured = attitude_from_directions(sun.value, earth.value, nadir)
        estimate.correct((sun.time_s + earth.time_s) / 2, measured, COARSE)


def off_deg(attitude: Vector) -> float:
    return float(np.linalg.norm(rate_between(WANTED, attitude, 1.0)))


def shown(sample: Sample | None) -> str:
    if sample is None:
        return "-"
    return f"{'no fix' if sample.value is None else 'fix'} {sample.time_s:.3f}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("sensors", nargs="?", choices=[*BOTH, "both"], default="both")
    parser.add_argument("--faults", action="store_true", help="latch-up and Moon")
    args = parser.parse_args()
    print("  time       error  star tracker     Sun              Earth")
    for row in loop(BOTH if args.sensors == "both" else (args.sensors,), args.faults):
        columns = "  ".join(f"{shown(one):15s}" for one in (row.star, row.sun, row.earth))
        print(f"{row.time_s:4.0f} s  {row.error_deg:8.4f} deg  {columns}".rstrip())
