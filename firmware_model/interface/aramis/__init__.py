"""The whole interface of AraMiS' star tracker: telecommands, telemetry, named numbers.

AraMiS thesis, section 2.2, has use cases but no bytes. Frames and buses are those of the CubeSpace
family's nodes; I2C address, baud rate, IDs and layouts are assumed.
"""

from cubestack.firmware_model.interface.aramis.codes import (
    CatalogueState,
    LatchUpStep,
    MeasurementMode,
    MeasurementOutcome,
    OnOff,
    Reason,
    ResetCause,
    SensorState,
    SpikeMethod,
)
from cubestack.firmware_model.interface.aramis.switches import AramisSwitches
from cubestack.firmware_model.interface.aramis.telecommands import (
    BLOCK_BYTES,
    IMAGE_BYTES,
    MOST_CATALOGUE_BYTES,
    MS_PER_DAY,
    TELECOMMANDS,
)
from cubestack.firmware_model.interface.aramis.telemetry import PHASES, TELEMETRY
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.node_messages import AckError

__all__ = [
    "BLOCK_BYTES",
    "IMAGE_BYTES",
    "INTERFACE",
    "MOST_CATALOGUE_BYTES",
    "MS_PER_DAY",
    "PHASES",
    "AckError",
    "CatalogueState",
    "LatchUpStep",
    "MeasurementMode",
    "MeasurementOutcome",
    "OnOff",
    "Reason",
    "ResetCause",
    "SensorState",
    "SpikeMethod",
]

INTERFACE = Interface(
    name="AraMiS",
    version=1,
    node_type=6,
    i2c_address=0x1D,
    baud=57_600,
    telecommands=TELECOMMANDS,
    telemetries=TELEMETRY,
    ack_errors=AckError,
    switches=AramisSwitches,
)
