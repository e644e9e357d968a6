"""The sensor modules; see `cubestack.basilisk`."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
from Basilisk.architecture import messaging, sysModel
from numpy.typing import ArrayLike, NDArray

from cubestack.basilisk.frames import euler_parameters, matrix_from_mrp
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.sampling import AttitudeSampler, DirectionSampler, Sampler

NS_PER_S = 10**9
EARTH_RADIUS_KM = 6378.137


class EmulatedSensor(sysModel.SysModel):
    """Base of the modules.

    Attributes:
        scStateInMsg: true state of the spacecraft; required.
        earthInMsg: position of the Earth; where it is not linked, the origin.
        sunInMsg, moonInMsg: positions; where they are not linked, as in the device's scene.
        device: the emulated device, for its scene, faults and recordings.
        dcm_CB: (3, 3), from the spacecraft's body axes to the axes of the device.
    """

    def __init__(
        self, sampler: Sampler, name: str, dcm_CB: ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    ) -> None:
        super().__init__()
        self.ModelTag = name
        self.device = sampler.device
        self.dcm_CB = np.asarray(dcm_CB, np.float64)
        self.scStateInMsg = messaging.SCStatesMsgReader()
        self.earthInMsg = messaging.SpicePlanetStateMsgReader()
        self.sunInMsg = messaging.SpicePlanetStateMsgReader()
        self.moonInMsg = messaging.SpicePlanetStateMsgReader()
        self._sampler = sampler

    def Reset(self, CurrentSimNanos: int) -> None:
        """Write a missing fix; ValueError without ``scStateInMsg``."""
        if not self.scStateInMsg.isLinked():
            raise ValueError(f"{self.ModelTag}: scStateInMsg is not connected")
        self._write(None, CurrentSimNanos, CurrentSimNanos)

    def UpdateState(self, CurrentSimNanos: int) -> None:
        """Write the measurement of the last call, and start one of the present state."""
        state = self.scStateInMsg()
        place = np.asarray(state.r_BN_N, np.float64)
        sample = self._sampler.step(
            CurrentSimNanos / NS_PER_S,
            _quaternion(self.dcm_CB @ matrix_from_mrp(state.sigma_BN)),
            np.degrees(self.dcm_CB @ np.asarray(state.omega_BN_B)),
            **self._bodies(place),
        )
        if sample is not None:
            self._write(sample.value, round(sample.time_s * NS_PER_S), CurrentSimNanos)

    def _bodies(self, place: NDArray[np.float64]) -> dict[str, Any]:
        bodies: dict[str, Any] = {}
        for name, reader in (("sun", self.sunInMsg), ("moon", self.moonInMsg)):
            if reader.isLinked():
                bodies[name] = np.asarray(reader().PositionVector) - place
        origin = np.asarray(self.earthInMsg().PositionVector) if self.earthInMsg.isLinked() else 0.0
        if self._sees_earth or self.earthInMsg.isLinked():
            bodies["nadir"] = origin - place
            bodies["altitude_km"] = np.linalg.norm(origin - place) / 1000 - EARTH_RADIUS_KM
        return bodies

    #: whether its scene has the Earth
    _sees_earth = True

    @abstractmethod
    def _write(self, value: NDArray[np.float64] | None, time_ns: int, now_ns: int) -> None:
        """Send the message of a measurement, with its time; None: there is no fix."""


class StarTracker(EmulatedSensor):
    """A CubeStar or AraMiS.

    Attributes:
        sensorOutMsg: STSensorMsg, inertial to the camera's axes ("case").
    """

    _sees_earth = False

    def __init__(self, device: AnyEmulated, **options: Any) -> None:
        """Use an opened star tracker; ``options`` are those of `EmulatedSensor`."""
        super().__init__(AttitudeSampler(device), device.device.name, **options)
        self.sensorOutMsg = messaging.STSensorMsg()

    def _write(self, value: NDArray[np.float64] | None, time_ns: int, now_ns: int) -> None:
        payload = messaging.STSensorMsgPayload()
        payload.timeTag = time_ns
        if value is not None:
            payload.qInrtl2Case = euler_parameters(value)
        self.sensorOutMsg.write(payload, now_ns, self.moduleID)


class SunSensor(EmulatedSensor):
    """The Sun camera of a CubeSense.

    Attributes:
        sunOutMsg: NavAttMsg with ``timeTag`` and ``vehSunPntBdy``.
    """

    def __init__(self, device: AnyEmulated, **options: Any) -> None:
        """Use an opened CubeSense, which an `EarthSensor` may share."""
        super().__init__(DirectionSampler(device, "sun"), "sun sensor", **options)
        self.sunOutMsg = messaging.NavAttMsg()

    def _write(self, value: NDArray[np.float64] | None, time_ns: int, now_ns: int) -> None:
        payload = messaging.NavAttMsgPayload()
        payload.timeTag = time_ns / NS_PER_S
        if value is not None:
            payload.vehSunPntBdy = (self.dcm_CB.T @ value).tolist()
        self.sunOutMsg.write(payload, now_ns, self.moduleID)


class EarthSensor(EmulatedSensor):
    """The nadir camera of a CubeSense.

    Attributes:
        nadirOutMsg: BodyHeadingMsg, to the Earth's centre; its header has the time of the image.
    """

    def __init__(self, device: AnyEmulated, **options: Any) -> None:
        """Use an opened CubeSense, which a `SunSensor` may share."""
        super().__init__(DirectionSampler(device, "nadir"), "earth sensor", **options)
        self.nadirOutMsg = messaging.BodyHeadingMsg()

    def _write(self, value: NDArray[np.float64] | None, time_ns: int, now_ns: int) -> None:
        del now_ns
        payload = messaging.BodyHeadingMsgPayload()
        if value is not None:
            payload.rHat_XB_B = (self.dcm_CB.T @ value).tolist()
        self.nadirOutMsg.write(payload, time_ns, self.moduleID)


def _quaternion(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    from cubestack.emulator.scene.attitude import quaternion_from_matrix

    return quaternion_from_matrix(matrix)
