"""The switches that a node's program runs with; telecommands change them between two pictures."""

from collections.abc import Mapping
from typing import Any, Generic

from cubestack.firmware_model.interface.codec import switch_messages

#: Telecommands that ``RunningSwitches.change`` executes.
SWITCH_COMMANDS = (switch_messages.SET_PROFILE, switch_messages.SET_SWITCH)


class RunningSwitches(Generic[switch_messages.SwitchesT]):
    """Whoever depends on a switch asks for ``now`` when it begins with a picture.

    The main loop executes telecommands between its other tasks, so never in the middle of one.

    Attributes:
        now: the present ones.
    """

    def __init__(self, at_power_up: switch_messages.SwitchesT) -> None:
        """Start with what was chosen when the device was powered up."""
        self._at_power_up = self.now = at_power_up

    def change(self, telecommand: str, values: Mapping[str, Any]) -> None:
        """Execute one of ``SWITCH_COMMANDS``."""
        self.now = switch_messages.after(self.now, telecommand, values)

    def forget(self) -> None:
        """Return to those of power-up."""
        self.now = self._at_power_up
