"""Supply monitoring: a comparator's interrupt cuts the load switch at once (latch-up).

CubeStar thesis, section 5.2.3. The main loop later powers the channel up again.
"""

from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.hardware import Hardware, ReadTimer, Routine, Sleep

__all__ = ["CHANNELS", "OFF_TIME_US", "SupplyMonitor"]

CHANNELS = ("memory", "imager")
OFF_TIME_US = 100_000
"""How long a channel stays off after a latch-up: ours, the sources give no time."""


class SupplyMonitor:
    """Cuts, counts and restores the two monitored supplies.

    Attributes:
        cut: channels that were cut by a comparator and wait for power cycling.
    """

    def __init__(self, hardware: Hardware, state: State) -> None:
        """Watch the channels of ``hardware``."""
        self._hardware = hardware
        self._state = state
        self.cut: list[str] = []
        self._imager_off = False
        self.lowest_ma = self.highest_ma = self.total_ma()

    def overcurrent(self, channel: str) -> None:
        """Interrupt: the comparator of ``channel`` tripped."""
        self._hardware.switch_supply(channel, False)
        self._state.raise_flag("OverCurrent")
        self._state.retained.latch_ups += 1
        self.cut.append(channel)
        self._hardware.wake()

    def total_ma(self) -> float:
        """Sum of both monitored currents."""
        return sum(self._hardware.supply_current_ma(channel) for channel in CHANNELS)

    def sample(self) -> float:
        """Measure the total, keep the extremes; in mA."""
        total = self.total_ma()
        self.lowest_ma = min(self.lowest_ma, total)
        self.highest_ma = max(self.highest_ma, total)
        return total

    @property
    def imager_on(self) -> bool:
        """Whether the switch of FPGA and imager is closed."""
        return not self._imager_off and "imager" not in self.cut

    def toggle_imager(self) -> Routine[bool]:
        """Open or close the switch of FPGA and imager; True when it was closed."""
        self._imager_off = not self._imager_off
        self._hardware.switch_supply("imager", not self._imager_off)
        yield ReadTimer()
        return not self._imager_off

    def power_cycle(self) -> Routine[bool]:
        """Restore what was cut; True when the imager came back, with its registers at reset."""
        camera_lost = False
        while self.cut:
            channel = self.cut.pop(0)
            now_us: int = yield ReadTimer()
            yield Sleep(now_us + OFF_TIME_US, wakeable=False)
            self._hardware.switch_supply(channel, True)
            self._state.retained.power_cycles += 1
            camera_lost |= channel == "imager"
            if channel == "memory":
                self._state.retained.image_present = 0
        return camera_lost
