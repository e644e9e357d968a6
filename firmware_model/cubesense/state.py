"""The node's memory: settings, the latest result of each camera, flags and counters.

All of it is in RAM and starts again with every reset. Settings start with the reset values that the
telecommands declare.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.masks import Mask
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, telecommands
from cubestack.firmware_model.interface.cubesense.switches import (
    DEFAULT_SWITCHES,
    CubeSenseSwitches,
)
from cubestack.firmware_model.node.state import NodeState, RunningSwitches

ERROR_FLAGS = ("TcmdBufferOverrun", "I2cTlmReadError", "UartProtocolError", "UartMsgIncomplete")
"""Flags of telemetry CommunicationStatus."""


def distortion_of(values: Mapping[str, Any]) -> tuple[float, ...]:
    """Factors of the polynomial, from the parameters of telecommand Distortion."""
    return tuple(
        codes.coefficient(values[f"Mantissa{power}"], values[f"Exponent{power}"])
        for power in range(telecommands.DISTORTION_TERMS)
    )


@dataclass
class CameraSettings:
    """Settings of one camera, in the units of the telecommands."""

    threshold: int  #: detection threshold in DN
    auto_adjust: int  #: 1: the camera adjusts itself
    exposure: int  #: as sent, u16; the camera gets at most 255
    gain: int  #: as sent; the camera gets at most 63
    #: blue_gain, red_gain: as sent
    blue_gain: int
    red_gain: int
    boresight: tuple[float, float]  #: (x, y) in px
    distortion: tuple[float, ...]  #: factors of the polynomial
    #: five areas that detection ignores; unused ones are all 0
    masks: list[Mask] = field(default_factory=lambda: [Mask()] * codes.MASK_AREAS)

    @classmethod
    def at_reset(cls, camera: codes.Camera) -> "CameraSettings":
        number = camera + 1

        def reset(name: str) -> dict[str, Any]:
            return dict(INTERFACE.telecommand(f"{name}{number}").reset_values())

        settings, boresight = reset("CameraSettings"), reset("Boresight")
        return cls(
            threshold=reset("DetectionThreshold")["Threshold"],
            auto_adjust=reset("AutoAdjust")["Enabled"],
            exposure=settings["Exposure"],
            gain=settings["Gain"],
            blue_gain=settings["BlueGain"],
            red_gain=settings["RedGain"],
            boresight=(boresight["X"], boresight["Y"]),
            distortion=distortion_of(reset("Distortion")),
        )


@dataclass(eq=False)
class CameraResult:
    """The latest measurement of one camera."""

    #: capture, detect: outcome
    capture: codes.CaptureResult = codes.CaptureResult.START_UP
    detect: codes.DetectResult = codes.DetectResult.START_UP
    #: alpha, beta: 1/100 deg; valid with SUCCESS only
    alpha: int = 0
    beta: int = 0
    #: x, y: centre from the boresight, undistorted, 1/100 px
    x: int = 0
    y: int = 0
    radius: int = 0  #: of the fitted circle, undistorted, 1/100 px; 0 for the Sun
    points: int = 0  #: edges of the fit, or Sun pixels of the mean
    sigma: tuple[int, int] = (0, 0)  #: standard deviations of alpha and beta, 1/100 deg; 0: unknown
    rms: int = 0  #: of the edges' distances from the circle, 1/100 px
    found: int = 0  #: edges that the search found, or Sun pixels
    reason: codes.Reason = codes.Reason.NONE  #: why the detection ended as it did
    #: pixels (n, 2) of the edges that the search found, in 1/32 px; none for the Sun
    edges: NDArray[np.int16] = field(default_factory=lambda: np.zeros((0, 2), np.int16))
    sram: codes.Sram = codes.Sram.SRAM1  #: memory that holds the image
    first: tuple[int, int] = (0, 0)  #: first Sun pixel (x, y); (0, 0) for the nadir camera
    pixels_read: int = 0  #: pixels that the processor read from the FPGA
    #: wait_us, store_us, search_us, centroid_us, total_us: as in telemetry PhaseTimes
    wait_us: int = 0
    store_us: int = 0
    search_us: int = 0
    centroid_us: int = 0
    total_us: int = 0


class State(NodeState):
    """RAM of the program.

    Attributes:
        telecommands, telemetries: number received, for CommunicationStatus.
        last_command, last_processed, last_error: for telemetry TcmdProcessed.
    """

    def __init__(self, switches: CubeSenseSwitches = DEFAULT_SWITCHES) -> None:
        super().__init__(ERROR_FLAGS)
        self.switches = RunningSwitches(switches)  #: in use
        #: settings of each camera
        self.cameras = {camera: CameraSettings.at_reset(camera) for camera in codes.Camera}
        #: latest measurement of each camera
        self.results = {camera: CameraResult(sram=codes.Sram(camera)) for camera in codes.Camera}
        #: by memory: it drew too much since the flag was cleared, and is kept off
        self.over_current = dict.fromkeys(codes.Sram, False)
        self.nadir_search = codes.NadirSearch.LINES  #: search method for the nadir camera's edges
        self.image_sram = codes.Sram.SRAM1  #: memory that register IMAGE streams
        self.reset_communication()

    def reset_communication(self) -> None:
        """Clear counters and error flags, for telecommand Reset of the communication."""
        self.telecommands = 0
        self.telemetries = 0
        self.flags.clear()
        self.last_command = 0
        self.last_processed = 1
        self.last_error = AckError.OK

    def schedule(self, camera: codes.Camera, sram: codes.Sram, *, detect: bool) -> None:
        """Mark the results of a measurement that was accepted and has not begun."""
        result = self.results[camera]
        result.capture = codes.CaptureResult.PENDING
        result.sram = sram
        result.detect = codes.DetectResult.PENDING if detect else codes.DetectResult.NONE_SCHEDULED
