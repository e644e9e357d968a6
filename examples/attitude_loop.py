"""A closed attitude loop: a simulated rigid body with an emulated star tracker.

python attitude_loop.py. Every two seconds the program reads the attitude from the CubeStar over its
serial line, turns the body with a proportional-derivative controller, advances virtual time, and
points the tracker's camera where the body then points.
"""

import numpy as np

import cubestack
from cubestack.emulator.scene.attitude import (
    matrix_from_quaternion,
    propagate,
    quaternion_from_pointing,
)
from cubestack.emulator.scene.orbit import rate_between
from cubestack.emulator.scene.sky import Pose, SkyScene

STEP_S = 2.0
INERTIA = 0.01  # kg m2, about each axis
GAIN, DAMPING = 0.01, 0.16  # rad/s2 per rad, and per rad/s
LARGEST_TORQUE_N_M = 1e-5  # of the wheels


def loop(steps: int, start_deg: float = 3.0, seed: int = 0) -> list[float]:
    """True angle from the wanted attitude in degrees, after each step."""
    wanted = quaternion_from_pointing(83.8, -5.4, 0.0)
    attitude = propagate(wanted, [start_deg, -start_deg / 2, start_deg / 3], 1.0)
    rate = np.zeros(3)  # deg/s, body axes
    last, errors = None, []
    with cubestack.open_device(
        "cubestar", SkyScene(attitude), seed=seed, profile="extended"
    ) as tracker:
        for step in range(steps):
            tracker.client.capture_and_process()
            found = tracker.client.attitude()
            if found.valid:
                seen = matrix_from_quaternion(found.quaternion)
                off = -rate_between(matrix_from_quaternion(wanted), seen, 1.0)  # deg
                turning = np.zeros(3) if last is None else (last - off) / STEP_S
                torque = INERTIA * np.radians(GAIN * off - DAMPING * turning)
                torque = np.clip(torque, -LARGEST_TORQUE_N_M, LARGEST_TORQUE_N_M)
            else:
                off, torque = None, np.zeros(3)
            last = off
            tracker.wait(max(0.0, (step + 1) * STEP_S - tracker.time_s))
            attitude = propagate(attitude, rate, STEP_S)
            rate = rate + np.degrees(torque / INERTIA) * STEP_S
            # From here on, the tracker's camera turns with the body.
            pose = Pose(attitude, tuple(rate), tracker.time_s)
            tracker.scene = SkyScene(pose.at(0.0), tuple(rate))
            left = rate_between(matrix_from_quaternion(wanted), matrix_from_quaternion(attitude), 1)
            errors.append(float(np.linalg.norm(left)))
    return errors


if __name__ == "__main__":
    for step, error in enumerate(loop(60), 1):
        print(f"{step * STEP_S:4.0f} s  {error:8.4f} deg")
