"""Shell commands for an emulated device: scene, point, fault, power, time, peek."""

from dataclasses import dataclass
from pathlib import Path

from cubestack.host.emulation.controls import Controls
from cubestack.host.shell.names import (
    CommandResult,
    ShellCommand,
    ShellError,
    check_count,
    to_number,
)
from cubestack.host.targets import Target

ON_OFF = ("on", "off")

SCENE = "scene FILE"
POINT = "point quaternion=X,Y,Z,W [rate_deg_s=X,Y,Z] [nadir|sun|moon=X,Y,Z] [altitude_km=KM]"
FAULT = "fault [KIND [TARGET] [PARAMETER=VALUE ...] [for_s=SECONDS]]"
LOG = "log"
"""Argument of ``fault`` that lists the fault events."""
POWER = "power [CHANNEL on|off]"
TIME = "time [SECONDS]"
PEEK = "peek UNIT[.REGISTER]|VARIABLE|ADDRESS"


@dataclass
class ControlCommands:
    """The commands on one target; the caller closes it."""

    target: Target

    def commands(self) -> list[ShellCommand]:
        return [
            ShellCommand(SCENE, "load another scene", self._scene, True),
            ShellCommand(POINT, "turn the device in its scene", self._point, True),
            ShellCommand(
                FAULT,
                "inject a fault; `fault clear` ends all, `fault log` lists events",
                self._fault,
                True,
            ),
            ShellCommand(POWER, "show supply currents, switch loads", self._power, True),
            ShellCommand(TIME, "show virtual time, or let it pass", self._time, True),
            ShellCommand(PEEK, "show memory of the processor with own firmware", self._peek, True),
        ]

    def _scene(self, words: list[str]) -> CommandResult:
        check_count(SCENE, words, 1, 1)
        self._controls.scene(Path(words[0]))
        return CommandResult([("", f"scene {words[0]}")], {"scene": words[0]})

    def _point(self, words: list[str]) -> CommandResult:
        self._controls.point(words)
        return CommandResult([("", f"point: {' '.join(words)}")], {"point": " ".join(words)})

    def _fault(self, words: list[str]) -> CommandResult:
        controls = self._controls
        if not words:
            return CommandResult(
                [("", fault) for fault in controls.faults], {"faults": controls.faults}
            )
        if words == [LOG]:
            log = controls.fault_log()
            return CommandResult([("", line) for line in log], {"log": log})
        controls.fault(words)
        return CommandResult([("", f"fault: {' '.join(words)}")], {"fault": " ".join(words)})

    def _power(self, words: list[str]) -> CommandResult:
        controls = self._controls
        if words:
            if len(words) != 2 or words[1] not in ON_OFF:
                raise ShellError(f"usage: {POWER}")
            controls.switch(words[0], words[1] == "on")
        currents = controls.currents()
        rows = [(name, f"{current:.1f} mA") for name, current in currents.items()]
        return CommandResult(rows, {"currents_ma": currents})

    def _time(self, words: list[str]) -> CommandResult:
        check_count(TIME, words, 0, 1)
        controls = self._controls
        if words:
            controls.advance(to_number("time", words[0], 0))
        now_s = controls.time_s()
        return CommandResult([("time", f"{now_s:.6f} s")], {"time_s": now_s})

    def _peek(self, words: list[str]) -> CommandResult:
        check_count(PEEK, words, 1, 1)
        found = self._controls.peek(words[0])
        rows = [(name, text) for name, (_, text) in found.items()]
        return CommandResult(rows, {"values": {name: value for name, (value, _) in found.items()}})

    @property
    def _controls(self) -> Controls:
        assert self.target.controls is not None  # the shell rejects any other
        return self.target.controls
