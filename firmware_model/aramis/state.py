"""The program's state in RAM: flags, counters, clock, latest result."""

from dataclasses import dataclass, field

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.aramis.settings import StoredSettings
from cubestack.firmware_model.aramis.solution import Solution
from cubestack.firmware_model.interface import aramis
from cubestack.firmware_model.interface.aramis import MS_PER_DAY, MeasurementOutcome, SensorState
from cubestack.firmware_model.interface.aramis.switches import DEFAULT_SWITCHES, AramisSwitches
from cubestack.firmware_model.interface.aramis.telemetry import FLAG_NAMES
from cubestack.firmware_model.mcu.memory import FlashStore
from cubestack.firmware_model.node.state import NodeState, RunningSwitches


class Clock:
    """Julian date, counted on from the instant that a host set it (thesis, section 2.2)."""

    _zero_ms: int | None = None

    @property
    def is_set(self) -> bool:
        return self._zero_ms is not None

    def set(self, day: int, millisecond: int, uptime_us: int) -> None:
        """Set it to ``millisecond`` after the noon that begins Julian ``day`` at ``uptime_us``."""
        self._zero_ms = day * MS_PER_DAY + millisecond - uptime_us // 1000

    def at(self, uptime_us: int) -> tuple[int, int]:
        """Julian day and milliseconds since its noon; both 0 while unset."""
        if self._zero_ms is None:
            return 0, 0
        return divmod(max(0, self._zero_ms + uptime_us // 1000), MS_PER_DAY)


@dataclass
class MeasurementResult:
    """The latest measurement."""

    #: how it ended
    outcome: MeasurementOutcome = MeasurementOutcome.NOT_MEASURED
    reason: aramis.Reason = aramis.Reason.NOT_MEASURED
    mode: aramis.MeasurementMode = aramis.MeasurementMode.LOST_IN_SPACE
    image_us: int = 0  #: uptime at mid-exposure of the middle row
    frame: int = 0  #: number of its picture
    #: what became of the picture; None without a picture or catalogue
    solution: Solution | None = None
    #: levels of the last pictures, and how many
    mean: int = 0
    threshold: int = 0
    pictures: int = 0
    #: duration of each step
    times_us: dict[str, int] = field(default_factory=lambda: dict.fromkeys(aramis.PHASES, 0))

    @property
    def valid(self) -> bool:
        return self.outcome is MeasurementOutcome.CONCLUSIVE

    @property
    def detected(self) -> int:
        return 0 if self.solution is None else len(self.solution.measured)


class State(NodeState):
    """RAM of the program.

    Attributes:
        settings: parameters of the setting telecommands.
        switches: those that the program runs with.
        clock: Julian date.
        sensor: what the star tracker does.
        measurement: the latest one.
        quaternion: (4,) the latest attitude, inertial to camera, scalar last; None without any.
        matched: stars that it rests on.
        frames: pictures since power-up.
        looping, loop_due_us, iterations, late: the loop.
        telecommands, telemetry: counters.
        star: number of the star that telemetry StarDetails shows next.
    """

    def __init__(self, flash: FlashStore, switches: AramisSwitches = DEFAULT_SWITCHES) -> None:
        super().__init__(FLAG_NAMES)
        self.settings = StoredSettings(flash)
        self.switches = RunningSwitches(switches)
        self.clock = Clock()
        self.sensor = SensorState.INACTIVE
        self.measurement = MeasurementResult()
        self.quaternion: Floats | None = None
        self.matched = 0
        self.frames = 0
        self.looping = False
        self.loop_due_us = self.iterations = self.late = 0
        self.telecommands = self.telemetry = 0
        self.star = 0
        if self.settings.damaged:
            self.raise_flag("ConfigError")

    @property
    def active(self) -> bool:
        return self.sensor in (SensorState.READY, SensorState.MEASURING, SensorState.PROGRAMMING)
