"""AraMiS' telecommands: the use cases of the thesis, then settings and service.

AraMiS thesis, section 2.2: requests of the attitude controller, the power management and the
integrator. The thesis defines no bytes, so all IDs and layouts are assumed; no use case covers
those from 100 on.
"""

import math
from dataclasses import replace

from cubestack.firmware_model.interface.aramis.codes import (
    LatchUpStep,
    MeasurementMode,
    OnOff,
    SpikeMethod,
)
from cubestack.firmware_model.interface.aramis.switches import AramisSwitches
from cubestack.firmware_model.interface.cameras import mt9m001
from cubestack.firmware_model.interface.codec.field import (
    Field,
    byte_array,
    enum8,
    f32,
    u8,
    u16,
    u32,
)
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switch_messages import switch_messages

#: Bytes of an image: one per pixel, row by row.
IMAGE_BYTES = mt9m001.COLUMNS * mt9m001.ROWS

#: Bytes of a block of an image or of the catalogue.
BLOCK_BYTES = 128

MS_PER_DAY = 86_400_000

#: Largest catalogue: as many blocks as a telecommand can number.
MOST_CATALOGUE_BYTES = 65_536 * BLOCK_BYTES

_DEFAULT_EXPOSURE_ROWS = 6299


def _components(meaning: str) -> tuple[Field, ...]:
    return tuple(
        f32(f"Q{i}", f"{name} part, {meaning}", reset=reset).within(-1, 1)
        for i, (name, reset) in enumerate((("x", 0.0), ("y", 0.0), ("z", 0.0), ("scalar", 1.0)))
    )


_USE_CASES = (
    Message(1, "Activate", "start the camera, load the catalogue, be ready to measure"),
    Message(
        2,
        "Deactivate",
        "stop the loop and the camera; settings stay",
        risk="measurements stop, and the camera is off",
    ),
    Message(3, "SetSystemTime", "set the clock to the time at which the telecommand arrived").of(
        u32("JulianDay", "whole Julian days, which begin at noon UT", "d"),
        u32("Millisecond", "since that noon", "ms", high=MS_PER_DAY - 1),
    ),
    Message(4, "GetAttitude", "measure the attitude, lost in space; result: Attitude"),
    Message(5, "GetAttitudeNearVector", "measure the attitude near a vector of length 1 +- 0.1").of(
        *(
            f32(axis, f"{axis} of the boresight's inertial unit vector").within(
                -1.1, 1.1, "DirectionError"
            )
            for axis in "XYZ"
        )
    ),
    Message(6, "GetAttitudeNearPoint", "measure the attitude near a direction").of(
        f32("RightAscension", "of the boresight", "rad").within(
            -math.pi, 2 * math.pi, "DirectionError"
        ),
        f32("Declination", "of the boresight", "rad").within(
            -math.pi / 2, math.pi / 2, "DirectionError"
        ),
    ),
    Message(
        7,
        "LatchUpAction",
        "turn the camera unit's supply off or on; off ends a latch-up, on sets the camera up again",
        risk="the supply of the camera unit changes",
    ).of(enum8("Step", "off, then on", choices=LatchUpStep, reset=LatchUpStep.ON)),
    Message(8, "BeginCatalogue", "begin an upload; CommitCatalogue replaces the catalogue").of(
        u32("Length", "of the catalogue's image", "bytes", reset=1).within(
            1, MOST_CATALOGUE_BYTES, "UploadError"
        ),
        u32("Checksum", "CRC-32 of the image"),
    ),
    Message(9, "CatalogueBlock", "a block of the catalogue's image, in any order").of(
        u16("BlockNumber", "block n covers bytes 128 n to 128 n + 127"),
        byte_array(BLOCK_BYTES, "Data", "bytes; those beyond the length are ignored"),
    ),
    Message(
        10,
        "CommitCatalogue",
        "check the upload, write it to flash error-coded, and use it",
        risk="the catalogue in flash is replaced",
    ),
    Message(
        11,
        "SetBodyRotation",
        "rotation from the star tracker's axes to the spacecraft's; kept in flash",
    ).of(*_components("v_body = q v_camera q*")),
)

_EXTENSIONS = (
    Message(100, "StartLoop", "measure periodically").of(
        u16("Period", "of the loop", "ms", reset=1000).within(200, 60_000),
        enum8("Mode", "aided: near the latest attitude, if there is one", choices=MeasurementMode),
    ),
    Message(101, "StopLoop", "stop measuring periodically"),
    Message(102, "SetExposure", "exposure of the image sensor").of(
        u16("Rows", "row times of 31.75 us", "rows", reset=_DEFAULT_EXPOSURE_ROWS).within(
            1, mt9m001.REGISTERS["SHUTTER_WIDTH"].field("ROWS").mask
        )
    ),
    Message(103, "SetGain", "gain of the image sensor, set to the nearest possible one").of(
        u8("Gain", "factor", scale=8, reset=mt9m001.HIGHEST_GAIN).within(1, mt9m001.HIGHEST_GAIN)
    ),
    Message(104, "SetDetection", "search for stars").of(
        u8("Sigmas", "threshold above the mean in standard deviations", scale=10, high=20, reset=2),
        enum8("Spikes", "how spikes are removed", choices=SpikeMethod, reset=SpikeMethod.CENTRE),
        u8("Needed", "bright pixels required in a window of 25", reset=13).within(1, 25),
        u16("MinPixels", "smallest star", "px", low=1, reset=1),
        u16("MaxPixels", "largest star", "px", low=1, reset=2500),
        u8("MaxStars", "the brightest are kept", reset=30).within(3, 64),
        enum8("Subtract", "subtract the mean before weighting", choices=OnOff, reset=OnOff.ON),
        ordered=(("MinPixels", "MaxPixels"),),
    ),
    Message(105, "SetIdentification", "identification of the stars").of(
        u16("Noise", "centroid's noise, per axis", "px", scale=1000, reset=0.151).within(0.01, 10),
        u8("Pivots", "largest number of pivot triangles", high=3, reset=3),
        enum8("Verify", "further stars confirm; published: off", choices=OnOff, reset=OnOff.ON),
        u16("HintTolerance", "largest error of the hint", "deg", scale=100, high=180, reset=6),
    ),
    Message(106, "SetField", "the lens").of(
        f32("FieldOfView", "across the image's height", "deg", reset=21.534639).within(5, 40),
        enum8("Round", "only the circle of that diameter is used", choices=OnOff, reset=OnOff.ON),
    ),
    Message(107, "SetReloadPeriod", "period at which the catalogue is reloaded from flash").of(
        u16("Period", "0: only if it is damaged", "s", reset=60)
    ),
    Message(108, "ReloadCatalogue", "load the catalogue from flash now"),
    Message(
        109,
        "RefreshCatalogue",
        "load the catalogue and rewrite it to flash without errors",
        risk="the catalogue in flash is rewritten",
    ),
    Message(
        110,
        "SaveConfig",
        "write all settings to flash",
        risk="the settings stored before are replaced",
    ),
    Message(
        111,
        "ClearConfig",
        "erase the settings in flash, return to the reset values",
        risk="the stored settings are erased",
    ),
    Message(112, "Reset", "restart the program, inactive", risk="the program restarts, inactive"),
    Message(113, "ClearErrorFlags", "clear all flags of telemetry ErrorFlags"),
    Message(114, "ImageBlockSet", "select the block that telemetry ImageBlock returns").of(
        u16("BlockNumber", "of the latest image", high=IMAGE_BYTES // BLOCK_BYTES - 1)
    ),
    Message(115, "StreamDownImage", "send the latest image as telemetry ImageBlock frames"),
    Message(
        116,
        "WriteCameraRegister",
        "write an image sensor register; a measurement restores exposure and gain",
    ).of(u8("Address", "register's address"), u16("Value", "value to write")),
    Message(
        117, "SelectCameraRegister", "read an image sensor register into telemetry CameraRegister"
    ).of(u8("Address", "register's address")),
)

*SET_SWITCHES, SWITCHES_SHOWN = switch_messages(AramisSwitches, 118, 210, "lost at a reset")

TELECOMMANDS = (
    *_USE_CASES,
    *(replace(message, extension=True) for message in _EXTENSIONS),
    *SET_SWITCHES,
)
