"""Supply monitoring: on a latch-up a comparator's interrupt opens the load switch at once.

CubeStar thesis, section 5.2.3. The main loop later powers the channel up again.
"""

from dataclasses import dataclass

from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.mcu.requests import Routine, pause

#: The processor's SRAM; the boards of FPGA and image sensor.
CHANNELS = ("memory", "imager")

OFF_TIME_US = 100_000  #: time for which a channel stays off after a latch-up: assumed

#: Less than any working part behind a switch draws: assumed, a quarter of an SRAM in standby.
UNDER_CURRENT_MA = 0.5


@dataclass(eq=False)
class SupplyMonitor:
    """Cuts, counts and restores the two monitored supplies."""

    state: State

    def overcurrent(self, channel: str) -> None:
        self.state.hardware.switch_supply(channel, False)
        retained = self.state.retained
        retained.cut |= 1 << CHANNELS.index(channel)
        retained.latch_ups += 1
        if channel == "memory":
            retained.image_present = 0
        self.state.raise_flag("OverCurrent")
        self.state.hardware.wake()

    @property
    def cut(self) -> list[str]:
        """Channels that a comparator cut off and that wait for ``restore``."""
        return [name for bit, name in enumerate(CHANNELS) if self.state.retained.cut >> bit & 1]

    @property
    def imager_on(self) -> bool:
        return self._is_on("imager")

    def sample(self) -> float:
        """Measure both channels and record the imager's extremes; returns its current in mA.

        A closed switch with almost no current raises UnderCurrent.
        """
        currents = {channel: self.state.hardware.supply_current_ma(channel) for channel in CHANNELS}
        if any(self._is_on(name) and ma < UNDER_CURRENT_MA for name, ma in currents.items()):
            self.state.raise_flag("UnderCurrent")
        retained, present_ua = self.state.retained, round(1000 * currents["imager"])
        first = retained.highest_ua == 0
        retained.lowest_ua = present_ua if first else min(retained.lowest_ua, present_ua)
        retained.highest_ua = max(retained.highest_ua, present_ua)
        return currents["imager"]

    def toggle_imager(self) -> bool:
        """Toggle the switch of FPGA and imager; returns whether it is closed now."""
        retained = self.state.retained
        retained.imager_off ^= 1
        retained.cut &= ~(1 << CHANNELS.index("imager"))
        self.state.hardware.switch_supply("imager", not retained.imager_off)
        return not retained.imager_off

    def restore(self) -> Routine[bool]:
        """Close the cut switches after a pause; True if the imager came back, at reset values.

        A channel that is cut meanwhile waits for the next call.
        """
        channels = self.cut
        yield from pause(OFF_TIME_US)
        for channel in channels:
            self.state.retained.cut &= ~(1 << CHANNELS.index(channel))
            self.state.retained.power_cycles += 1
            self.state.hardware.switch_supply(channel, True)
        return "imager" in channels

    def _is_on(self, channel: str) -> bool:
        off = self.state.retained.imager_off if channel == "imager" else 0
        return not off and channel not in self.cut
