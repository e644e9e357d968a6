"""The switches that a node's program runs with; telecommands change them between two images."""

from collections.abc import Mapping
from typing import Any, Generic

from cubestack.firmware_model.interface.codec import switch_messages

#: Telecommands that ``RunningSwitches.change`` executes.
SWITCH_COMMANDS = (switch_messages.SET_PROFILE, switch_messages.SET_SWITCH)


class RunningSwitches(Generic[switch_messages.SwitchesT]):
    """Switches in use; a user of a switch reads ``now`` when it begins with an image.

    The main loop executes telecommands between its other tasks, so never during one.
    """

    def __init__(self, at_power_up: switch_messages.SwitchesT) -> None:
        self._at_power_up = self.now = at_power_up  #: now: current switches

    def change(self, telecommand: str, values: Mapping[str, Any]) -> None:
        self.now = switch_messages.apply_command(self.now, telecommand, values)

    def forget(self) -> None:
        self.now = self._at_power_up
