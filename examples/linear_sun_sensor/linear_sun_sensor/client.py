"""SunSlit as a program uses it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.sensor import DeviceClient, Progress
from linear_sun_sensor.interface import Outcome


@dataclass(frozen=True)
class SunAngle:
    """A measurement; the angle is None where the Sun was not found."""

    angle_deg: float | None
    peak: int
    outcome: Outcome
    duration_ms: float


class SunSlit(DeviceClient):
    """A SunSlit behind a client; errors are those of the client."""

    def measure(self) -> SunAngle:
        """Expose and look for the Sun."""
        self.perform("Measure")
        values = self.client.telemetry("SunAngle")
        outcome = Outcome(int(values["Outcome"]))
        angle = float(values["Angle"]) if outcome is Outcome.MEASURED else None
        return SunAngle(angle, int(values["Peak"]), outcome, float(values["Duration"]))

    def set_exposure(self, microseconds: int) -> None:
        """Set the integration time, 400 to 50000 us."""
        self.perform("SetExposure", Exposure=microseconds)

    def set_threshold(self, level: int) -> None:
        """Set what is taken for the Sun, 1 to 200 DN above the darkest pixel."""
        self.perform("SetThreshold", Threshold=level)

    def picture(
        self, source: str | None = None, progress: Progress | None = None
    ) -> NDArray[np.uint8]:
        """The latest readout, shape (1, 128)."""
        data = self.client.telemetry("Pixels")["Pixels"]
        assert isinstance(data, bytes)
        if progress is not None:
            progress(1, 1)
        return np.frombuffer(data, np.uint8).reshape(1, -1)
