"""The attitude loop of a 3U satellite in Basilisk, with an emulated CubeStar and CubeSense.

python closed_loop.py [star-tracker|sun-earth|both] [--faults] [--out FOLDER]. Basilisk has the
orbit, the rigid body and the messages. Geometry, faults, estimator and control law are those of
../attitude_loop.py. --out writes the messages as CSV, and plots.
"""

import argparse
import csv
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import extForceTorque, gravityEffector, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros
from Basilisk.utilities.RigidBodyKinematics import C2MRP
from numpy.typing import NDArray

import cubestack
from cubestack.basilisk import EarthSensor, StarTracker, SunSensor
from cubestack.basilisk.frames import matrix_from_mrp
from cubestack.emulator.scene.attitude import (
    matrix_from_quaternion,
    propagate,
    quaternion_from_matrix,
)

sys.path.append(str(Path(__file__).parents[1]))
import attitude_loop as plain

NS_PER_S = 10**9
GM_M3_S2 = 3.986004418e14
AU_M, MOON_M = 1.496e11, 3.844e8

Vector = NDArray[np.float64]
Fix = tuple[float, Vector]  # time in s, and inertial to body (3, 3)


class Control(sysModel.SysModel):
    """Estimates the attitude from the sensors' messages, and commands the wheels' torque."""

    def __init__(self) -> None:
        super().__init__()
        self.ModelTag = "control"
        self.starInMsg = messaging.STSensorMsgReader()
        self.sunInMsg = messaging.NavAttMsgReader()
        self.nadirInMsg = messaging.BodyHeadingMsgReader()
        self.torqueOutMsg = messaging.CmdTorqueBodyMsg()
        self._estimate = plain.Estimator()
        self._torque = np.zeros(3)
        self._newest_s = 0.0

    def Reset(self, CurrentSimNanos: int) -> None:
        """Nothing to do."""

    def UpdateState(self, CurrentSimNanos: int) -> None:
        """One step of the loop."""
        if CurrentSimNanos:
            parts = round(plain.STEP_S / plain.PART_S)
            for left in reversed(range(parts)):
                now_s = CurrentSimNanos / NS_PER_S - left * plain.PART_S
                self._estimate.predict(now_s, plain.PART_S, self._torque)
        for fix, gains in ((self._star(), plain.FINE), (self._directions(), plain.COARSE)):
            if fix is not None and fix[0] > self._newest_s:
                self._estimate.correct(*fix, gains)
                self._newest_s = CurrentSimNanos / NS_PER_S - plain.STEP_S
                break
        self._torque = self._estimate.torque()
        payload = messaging.CmdTorqueBodyMsgPayload()
        payload.torqueRequestBody = self._torque.tolist()
        self.torqueOutMsg.write(payload, CurrentSimNanos, self.moduleID)

    def _star(self) -> Fix | None:
        found = self.starInMsg() if self.starInMsg.isLinked() else None
        if found is None or not any(found.qInrtl2Case):
            return None
        w, x, y, z = found.qInrtl2Case
        seen = matrix_from_quaternion([-x, -y, -z, w])
        return found.timeTag / NS_PER_S, plain.TRACKER.T @ seen

    def _directions(self) -> Fix | None:
        if not self.sunInMsg.isLinked():
            return None
        sun, nadir = self.sunInMsg(), self.nadirInMsg()
        if not any(sun.vehSunPntBdy) or not any(nadir.rHat_XB_B):
            return None
        earth_s = self.nadirInMsg.timeWritten() / NS_PER_S
        directions = np.array(sun.vehSunPntBdy), np.array(nadir.rHat_XB_B)
        attitude = plain.attitude_from_directions(*directions, plain.nadir_at(earth_s))
        return (sun.timeTag + earth_s) / 2, attitude


class Scenario:
    """Spacecraft, sensors and control.

    Attributes:
        truth: recorder of the spacecraft's state.
        star, sun, nadir: recorders of the sensors' messages.
    """

    def __init__(self, stack: ExitStack, sensors: tuple[str, ...], faults: bool, seed: int) -> None:
        self._sim = SimulationBaseClass.SimBaseClass()
        process = self._sim.CreateNewProcess("satellite")
        slow_s = plain.SLOW_S.get(sensors, plain.STEP_S)
        # At the same time the body moves first, then the sensors measure, then the loop acts.
        tasks = (("body", plain.PART_S, 3), ("slow", slow_s, 2), ("loop", plain.STEP_S, 1))
        for name, step_s, priority in tasks:
            process.addTask(self._sim.CreateNewTask(name, macros.sec2nano(step_s)), priority)

        start = propagate(quaternion_from_matrix(plain.WANTED), plain.START_DEG, 1.0)
        body, torque = _spacecraft(matrix_from_quaternion(start)), extForceTorque.ExtForceTorque()
        body.addDynamicEffector(torque)
        self._sim.AddModelToTask("body", torque, 2)
        self._sim.AddModelToTask("body", body, 1)

        sky = cubestack.SkyScene(start, hazards=(plain.DUSTY,) if faults else ())
        star, sense = (
            stack.enter_context(cubestack.open_device(name, scene, seed=seed, profile="extended"))
            for name, scene in (("cubestar", sky), ("cubesense", None))
        )
        tracker = StarTracker(star, dcm_CB=plain.TRACKER)
        sun, earth, control = SunSensor(sense), EarthSensor(sense), Control()
        for module in (tracker, sun, earth):
            module.scStateInMsg.subscribeTo(body.scStateOutMsg)
        payload = messaging.SpicePlanetStateMsgPayload()
        payload.PositionVector = (AU_M * plain.SUN / np.linalg.norm(plain.SUN)).tolist()
        sun_position, self._moon = messaging.SpicePlanetStateMsg(), messaging.SpicePlanetStateMsg()
        sun_position.write(payload)
        for module in (sun, earth):
            module.sunInMsg.subscribeTo(sun_position)
        if faults:
            tracker.moonInMsg.subscribeTo(self._moon)
            star.faults.inject_words(plain.LATCH_UP)
        if "star-tracker" in sensors:
            self._sim.AddModelToTask("loop", tracker, 3)
            control.starInMsg.subscribeTo(tracker.sensorOutMsg)
        if "sun-earth" in sensors:
            self._sim.AddModelToTask("slow", sun, 2)
            self._sim.AddModelToTask("slow", earth, 1)
            control.sunInMsg.subscribeTo(sun.sunOutMsg)
            control.nadirInMsg.subscribeTo(earth.nadirOutMsg)
        self._sim.AddModelToTask("loop", control, 2)
        torque.cmdTorqueInMsg.subscribeTo(control.torqueOutMsg)

        self.truth = body.scStateOutMsg.recorder()
        self.star, self.sun, self.nadir = (
            message.recorder()
            for message in (tracker.sensorOutMsg, sun.sunOutMsg, earth.nadirOutMsg)
        )
        used = {"star-tracker": (self.star,), "sun-earth": (self.sun, self.nadir)}
        for recorder in (self.truth, *(one for name in sensors for one in used[name])):
            self._sim.AddModelToTask("loop", recorder, 1)
        self._kept = body, torque, tracker, sun, earth, control, sun_position

    def run(self, until_s: float = 200.0) -> None:
        """Run it from the start."""
        self._sim.InitializeSimulation()
        for time_s in np.arange(0.0, until_s + plain.STEP_S / 2, plain.STEP_S):
            payload = messaging.SpicePlanetStateMsgPayload()
            payload.PositionVector = (MOON_M * plain.moon_at(time_s)).tolist()
            self._moon.write(payload)
            self._sim.ConfigureStopTime(macros.sec2nano(time_s))
            self._sim.ExecuteSimulation()

    def errors_deg(self) -> Vector:
        """True angle from the wanted attitude at each step."""
        return np.array([plain.off_deg(matrix_from_mrp(one)) for one in self.truth.sigma_BN])

    def rows(self) -> list[list[float | str]]:
        """Time, error, and the messages as they stand at each step; empty for a missing fix."""
        messages = (
            (np.divide(self.star.timeTag, NS_PER_S), self.star.qInrtl2Case, 4),
            (self.sun.timeTag, self.sun.vehSunPntBdy, 3),
            (np.divide(self.nadir.timesWritten(), NS_PER_S), self.nadir.rHat_XB_B, 3),
        )
        found = []
        for step, (time_ns, error) in enumerate(
            zip(self.truth.times(), self.errors_deg(), strict=True)
        ):
            row: list[float | str] = [float(time_ns / NS_PER_S), float(error)]
            for tags, values, count in messages:
                seen = values[step].tolist() if len(tags) else []  # none without the sensor
                row.append(float(tags[step]) if len(tags) else "")
                row += seen if any(seen) else [""] * count
            found.append(row)
        return found


COLUMNS = (
    *("time_s", "error_deg", "star_tag_s", "q0", "q1", "q2", "q3"),
    *("sun_tag_s", "sun_x", "sun_y", "sun_z", "nadir_tag_s", "nadir_x", "nadir_y", "nadir_z"),
)


def _spacecraft(attitude: Vector) -> spacecraft.Spacecraft:
    """The satellite on its orbit, the Earth at the origin."""
    body = spacecraft.Spacecraft()
    body.hub.mHub = 4.0
    body.hub.IHubPntBc_B = plain.INERTIA.tolist()
    earth = gravityEffector.GravBodyData()
    earth.planetName, earth.mu, earth.isCentralBody = "earth", GM_M3_S2, True
    body.gravField.gravBodies = spacecraft.GravBodyVector([earth])
    radius_m = (6378.137 + plain.ALTITUDE_KM) * 1000
    along = plain.nadir_at(-0.5) - plain.nadir_at(0.5)
    speed = np.sqrt(GM_M3_S2 / radius_m)
    body.hub.r_CN_NInit = (-radius_m * plain.nadir_at(0.0)).tolist()
    body.hub.v_CN_NInit = (speed * along / np.linalg.norm(along)).tolist()
    body.hub.sigma_BNInit = C2MRP(attitude).tolist()
    body.hub.omega_BN_BInit = np.radians(plain.START_DEG_S).tolist()
    return body


def write(scenario: Scenario, folder: Path) -> None:
    """Write messages.csv and loop.png."""
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    rows = scenario.rows()
    with (folder / "messages.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([COLUMNS, *rows])
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 5), height_ratios=(3, 1))
    above.semilogy([row[0] for row in rows], [row[1] for row in rows])
    above.set_ylabel("pointing error, deg")
    for height, (name, tag, value) in enumerate((("star", 2, 3), ("Sun", 7, 8), ("Earth", 11, 12))):
        for missing, colour in ((False, "tab:green"), (True, "tab:red")):
            tags = [row[tag] for row in rows if row[tag] and (row[value] == "") is missing]
            below.plot(tags, [height] * len(tags), "|", color=colour, label=name)
    below.set_yticks(range(3), ["star tracker", "Sun", "Earth"])
    below.set_ylim(-0.5, 2.5)
    below.set_xlabel("time, s; green: a fix, red: none")
    figure.tight_layout()
    figure.savefig(folder / "loop.png", dpi=100)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("sensors", nargs="?", choices=[*plain.BOTH, "both"], default="both")
    parser.add_argument("--faults", action="store_true", help="latch-up and Moon")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder for messages.csv and loop.png")
    args = parser.parse_args()
    sensors = plain.BOTH if args.sensors == "both" else (args.sensors,)
    with ExitStack() as stack:
        scenario = Scenario(stack, sensors, args.faults, args.seed)
        began_s = time.process_time()
        scenario.run()
        spent_s = time.process_time() - began_s
    for row in scenario.rows()[::5]:
        print(f"{row[0]:4.0f} s  {row[1]:8.4f} deg")
    print(f"200 s in {spent_s:.1f} s of processor time")
    if args.out is not None:
        write(scenario, args.out)


if __name__ == "__main__":
    main()
