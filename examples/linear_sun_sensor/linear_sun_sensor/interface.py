"""SunSlit's telecommands and telemetry, all assumed: firmware, host and documents take this table.

Frames, buses and the messages of every node are those of the CubeSpace family.
"""

from enum import IntEnum

from cubestack.sensor import Message, byte_array, enum8, f32, node_interface, u8, u16

PIXELS = 128
PITCH_MM = 0.0635
"""TSL1401CL data sheet: 400 pixels an inch."""

SLIT_MM = 4.0
"""Height of the slit above the array: assumed, for a field of +-45 degrees."""


class Outcome(IntEnum):
    """How the latest measurement ended."""

    NOT_MEASURED = 0
    MEASURED = 1
    NO_SUN = 2  # no pixel is above the threshold
    NO_READOUT = 3  # the FPGA did not acknowledge


_EXPOSURE = u16("Exposure", "integration time", "us", reset=2000)
_THRESHOLD = u8("Threshold", "what is taken for the Sun, above the darkest pixel", "DN", reset=40)

INTERFACE = node_interface(
    "SunSlit",
    i2c_address=0x28,
    flags={"ReadoutError": "the FPGA did not acknowledge a readout"},
    telecommands=(
        Message(10, "Measure", "expose, read the array, look for the Sun; result: SunAngle"),
        Message(11, "SetExposure", "set the integration time").of(_EXPOSURE.within(400, 50_000)),
        Message(12, "SetThreshold", "set the threshold").of(_THRESHOLD.within(1, 200)),
    ),
    telemetries=(
        Message(140, "SunAngle", "the latest measurement").of(
            f32("Angle", "of the Sun, from the boresight along the array", "deg"),
            f32("Centroid", "of its light, from the first pixel's middle", "px"),
            u8("Peak", "brightest pixel", "DN"),
            enum8("Outcome", "how it ended", choices=Outcome),
            u16("Duration", "from the request to the result", "ms", scale=100),
        ),
        Message(141, "Settings", "what telecommands have set").of(_EXPOSURE, _THRESHOLD),
        Message(142, "Pixels", "the latest readout").of(
            byte_array(PIXELS, "Pixels", "brightness of each, from the first one on")
        ),
    ),
)
