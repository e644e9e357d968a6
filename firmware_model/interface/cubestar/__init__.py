"""CubeStar's whole interface: telecommands, telemetry, and named numbers.

CubeSpace family of nodes, interface version 3, node dialect on the UART. Assumed where nothing is
published: the I2C address, 57600 baud, telecommands 100-127 and telemetry 200-255. Telecommands
13 and 14 and telemetry 142 belong to a later image sensor and access the registers of this one
through a page (SetCameraRegisterPage); telemetry 138 is rejected as an unknown ID.
"""

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.cubestar.codes import (
    Disc,
    IdMode,
    ImageBlockSize,
    MatchMode,
    MemoryTest,
    RateOutcome,
    Reason,
    ResetCause,
    SwitchState,
    TaskStatus,
    TestPattern,
)
from cubestack.firmware_model.interface.cubestar.extensions import (
    EXTENSION_TELECOMMANDS,
    EXTENSION_TELEMETRY,
    UPLOAD_BLOCK_BYTES,
)
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.firmware_model.interface.cubestar.telecommands import (
    IMAGE_BYTES,
    PUBLISHED_TELECOMMANDS,
)
from cubestack.firmware_model.interface.cubestar.telemetry import PUBLISHED_TELEMETRY

__all__ = [
    "IMAGE_BYTES",
    "INTERFACE",
    "UPLOAD_BLOCK_BYTES",
    "AckError",
    "Disc",
    "IdMode",
    "ImageBlockSize",
    "MatchMode",
    "MemoryTest",
    "RateOutcome",
    "Reason",
    "ResetCause",
    "SwitchState",
    "TaskStatus",
    "TestPattern",
]

INTERFACE = Interface(
    name="CubeStar",
    version=3,
    node_type=5,
    i2c_address=0x1A,
    baud=57_600,
    telecommands=PUBLISHED_TELECOMMANDS + EXTENSION_TELECOMMANDS,
    telemetries=tuple(sorted(PUBLISHED_TELEMETRY + EXTENSION_TELEMETRY, key=lambda m: m.id)),
    ack_errors=AckError,
    switches=CubeStarSwitches,
)
