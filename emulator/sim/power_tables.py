"""What the parts of each board draw, by state, and behind which load switch they are."""

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["CUBESENSE", "CUBESTAR", "Part", "PowerTable"]


@dataclass(frozen=True)
class Part:
    """A consumer.

    Attributes:
        channel: load switch that it is behind; None for the unswitched supply.
        ma: current in mA by state; it starts in the first one.
    """

    channel: str | None
    ma: Mapping[str, float]


@dataclass(frozen=True)
class PowerTable:
    """A board's supplies.

    Attributes:
        volts: of the supply that the currents are drawn from.
        parts: by name.
        channels: load switches, with the trip current of each one's comparator in mA; None where
            there is no comparator.
    """

    volts: float
    parts: Mapping[str, Part]
    channels: Mapping[str, float | None]


#: CubeStar thesis, sections 5.2.3 and 6.3, table 6.2: the whole stack's current in four modes. The
#: split into parts is fitted to them, with two parts known otherwise: the two LEDs (396.2 mW less
#: 350 mW), and the processor's 200 uA/MHz running and 50 uA/MHz asleep (appendix E). Trip currents
#: are assumed: a third above the highest regular one for the boards with imager and FPGA, ten times
#: it for the memory, which draws little.
CUBESTAR = PowerTable(
    volts=3.3,
    parts={
        "leds": Part(None, {"on": 14.0}),  # published: 46.2 mW
        "processor": Part(None, {"sleep": 2.4, "run": 9.6}),  # datasheet: 48 MHz
        "memory": Part("memory", {"standby": 2.0, "transfer": 3.0}),  # assumed share
        "imager": Part("imager", {"disabled": 42.8, "enabled": 92.8}),  # fitted: mode 2 less 1
        # Fitted: mode 3 less mode 2 and mode 4 less mode 1, less running processor and memory.
        "fpga": Part("imager", {"standby": 10.0, "storing": 58.9, "reading": 12.41}),
    },
    channels={"memory": 30.0, "imager": 200.0},
)

_SRAM = {"standby": 4.6, "active": 7.6}
_CAMERA = {"on": 25.15}

#: CubeSense thesis, table 7.1: the whole board's current at 5 V in eight states. Each figure is the
#: mean of what the two halves add: 4.4 and 4.8 mA a memory, 27.8 and 22.5 mA a camera, 7.4 and
#: 7.2 mA a side that is imaging. How the last divides among memory and FPGA is assumed. Reading
#: has a ninetieth of imaging's clock, so it counts as none. Currents are measured at 5 V, ahead of
#: linear regulators, so each is also the part's own.
CUBESENSE = PowerTable(
    volts=5.0,
    parts={
        "processor": Part(None, {"reset": 0.0, "on": 4.0}),
        "fpgas": Part(None, {"on": 8.4}),
        "sun_fpga": Part(None, {"idle": 0.0, "imaging": 4.3}),
        "nadir_fpga": Part(None, {"idle": 0.0, "imaging": 4.3}),
        "sram1": Part("SRAM1", _SRAM),
        "sram2": Part("SRAM2", _SRAM),
        "sun_camera": Part("sun_camera", _CAMERA),
        "nadir_camera": Part("nadir_camera", _CAMERA),
    },
    channels={"SRAM1": None, "SRAM2": None, "sun_camera": None, "nadir_camera": None},
)
