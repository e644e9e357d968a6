"""Measurements of emulated devices for a simulation that runs in steps.

A measurement takes a device tenths of a second. A simulation that waits for it would see results
before they exist. So a sampler starts a measurement in one step and collects it in a later one,
together with the time of its image::

    tracker = AttitudeSampler(device)
    for time_s, quaternion, rate_deg_s in motion:
        sample = tracker.step(time_s, quaternion, rate_deg_s)

All devices have the time of the simulation: both begin at 0.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.errors import HostError

MEASURE = ("CaptureAndProcess", "GetAttitude")
"""Telecommands that start a measurement of an attitude; a device has one of them."""

EXPOSING_S = 2.0
"""Longest time from an image to the request that uses it: a camera may run freely (assumed)."""

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sample:
    """A measurement that has ended.

    Attributes:
        time_s: of the image, at the middle of its exposure; without an image, of its request.
        value: None for a missing fix; else a quaternion (4,), scalar last, inertial to camera, or a
            unit vector (3,) in body axes.
    """

    time_s: float
    value: Vector | None


class Sampler(ABC):
    """Measures with a device; several samplers may share one.

    Attributes:
        device: it.
    """

    def __init__(self, device: AnyEmulated) -> None:
        self.device = device
        self._requested_s: float | None = None
        self._refused = False
        self._last_s = 0.0

    def step(
        self, time_s: float, quaternion: ArrayLike, rate_deg_s: ArrayLike, **bodies: Any
    ) -> Sample | None:
        """Let the device run to ``time_s``, then collect a measurement and start the next one.

        Args:
            time_s: present time of the simulation.
            quaternion: the device's attitude then, and the rate: as in ``EmulatedDevice.point``.
            rate_deg_s: body rate, likewise.
            bodies: directions of Earth, Sun and Moon, likewise.

        Returns:
            What was measured since the last step; None while the device is still busy, and in the
            first step.

        Raises:
            ValueError: as ``EmulatedDevice.point``, and for a time before the last step.
        """
        from cubestack.emulator.scene.attitude import propagate

        device, requested_s = self.device, self._requested_s
        if time_s < self._last_s:
            raise ValueError(f"{device.device.name} cannot go back to {time_s:g} s; open it again")
        self._last_s = time_s
        device.wait(max(0.0, time_s - device.time_s))
        sample = None
        if requested_s is not None and time_s >= requested_s:
            sample = self._collect(requested_s)
        # Exchanges take time, and long where the device does not answer.
        now = propagate(quaternion, rate_deg_s, device.time_s - time_s)
        device.point(now, rate_deg_s, **bodies)
        if requested_s is not None and sample is None:
            return None
        try:
            self._start()
            self._refused = False
        except HostError:
            self._refused = True
        self._requested_s = device.time_s
        return sample

    def _collect(self, requested_s: float) -> Sample | None:
        try:
            return Sample(requested_s, None) if self._refused else self._result(requested_s)
        except HostError:
            return Sample(requested_s, None)

    @abstractmethod
    def _start(self) -> None:
        """Request a measurement; HostError if the device does not answer."""

    @abstractmethod
    def _result(self, requested_s: float) -> Sample | None:
        """The measurement requested then, None if it has not ended; HostError likewise."""


class AttitudeSampler(Sampler):
    """Measures attitudes with a star tracker, a CubeStar or an active AraMiS."""

    def __init__(self, device: AnyEmulated) -> None:
        super().__init__(device)
        known = {one.name for one in device.device.interface.telecommands}
        self._measure = next(name for name in MEASURE if name in known)
        self._boot_s = 0.0
        self._frame: object = 0

    def _start(self) -> None:
        self.device.client.client.command(self._measure)

    def _result(self, requested_s: float) -> Sample | None:
        client = self.device.client
        if not client.client.telemetry("TcmdProcessed")["Processed"]:
            return None
        found = client.latest()
        if not found["valid"] or found["frame"] == self._frame:
            return Sample(requested_s, None)
        self._frame = found["frame"]
        uptime_s = float(found["image_time_s"] or 0.0)
        if uptime_s + self._boot_s < requested_s - EXPOSING_S:  # its clock begins again by a reset
            about = client.client.telemetry("Identification")
            running_s = int(about["RuntimeSeconds"]) + int(about["RuntimeMilliseconds"]) / 1000
            self._boot_s = self.device.time_s - running_s
        quaternion = np.array([found[f"q{index}"] for index in range(4)], np.float64)
        return Sample(uptime_s + self._boot_s, quaternion)


class DirectionSampler(Sampler):
    """Measures the Sun or the Earth's centre with a camera of a CubeSense, in body axes.

    A memory that was switched off after a latch-up is switched on again for the next measurement.
    """

    def __init__(self, device: AnyEmulated, target: Literal["sun", "nadir"]) -> None:
        from cubestack.emulator.scene.earth_sun import CameraTarget

        super().__init__(device)
        self._camera = CameraTarget[target.upper()]

    def _start(self) -> None:
        client: Any = self.device.client
        for camera in type(self._camera):  # so that this one begins at once
            client.wait_measured(camera)
        client.client.command("CaptureAndDetect", Camera=self._camera, Sram=self._camera)

    def _result(self, requested_s: float) -> Sample | None:
        client: Any = self.device.client
        found = client.result(self._camera)
        if found.pending:
            return None
        if found.capture.name == "SRAM_OVER_CURRENT":
            client.clear_over_current()
        if not found.detected:
            return Sample(requested_s, None)
        phases = client.phase_times(self._camera)
        time_s = requested_s + (phases["wait"] + phases["store"] / 2) / 1000
        mounting = getattr(self.device.scene, f"{self._camera.name.lower()}_camera")
        return Sample(time_s, mounting.matrix.T @ found.vector)
