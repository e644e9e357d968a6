"""Supplies: switches of memories and cameras, current monitors, latch-up of a memory.

CubeSense thesis, section 3.2.1.1: a monitor and a switch for each memory, read by the converter.
There is no comparator, so the program polls: every few milliseconds while it waits, and after every
line that it reads. A memory that draws too much is cut off at once and stays off until telecommand
ClearOverCurrent, because its contents are lost.
"""

from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware
from cubestack.firmware_model.cubesense.state import State
from cubestack.firmware_model.interface.cubesense.codes import Sram
from cubestack.firmware_model.interface.cubesense.pins import MA_PER_COUNT, SRAM_POWER, Monitor
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Routine, SetPin, Sleep

#: Assumed: four times the current of a working memory here (15 mA; table 7.1 has some 5 mA at 5 V),
#: and far below that of a latch-up.
OVER_CURRENT_MA = 60.0

SAMPLE_US = 5_000  #: longest time between two readings of the monitors while the program waits
OFF_TIME_US = 100_000  #: shortest off time of a supply in a power cycle: assumed
SETTLE_US = 1_000  #: from a supply's switch to its first use: assumed

_LIMIT_COUNTS = round(OVER_CURRENT_MA / MA_PER_COUNT)

_MONITORS = {Sram.SRAM1: Monitor.SRAM1, Sram.SRAM2: Monitor.SRAM2}


class Supply:
    """The memories' supplies, and all current monitors; at first all are off, as at reset."""

    def __init__(self, hardware: CubeSenseHardware, meter: Meter, state: State) -> None:
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._on = dict.fromkeys(Sram, False)
        self._cut_us = dict.fromkeys(Sram, 0)

    def start(self) -> Routine[None]:
        for sram in Sram:
            yield from self._switch(sram, True)
        yield from self.pause(SETTLE_US)

    def available(self, sram: Sram) -> bool:
        return self._on[sram]

    def sample(self) -> Routine[None]:
        """Check both memories that are on, and cut off one that draws too much."""
        for sram in Sram:
            if not self._on[sram]:
                continue
            self._meter.charge(adc_conversion=1, i16_add=1)
            yield Pay()  # the conversion is over
            if self._hardware.adc_counts(_MONITORS[sram]) > _LIMIT_COUNTS:
                yield from self._switch(sram, False)
                self._state.over_current[sram] = True
                self._cut_us[sram] = yield ReadTimer()

    def watch_until(self, deadline_us: int) -> Routine[None]:
        """Wait, and monitor the memories."""
        while True:
            yield from self.sample()
            now_us: int = yield ReadTimer()
            if now_us >= deadline_us:
                return
            yield Sleep(min(deadline_us, now_us + SAMPLE_US), wakeable=False)

    def idle(self) -> Routine[None]:
        """Check the memories and sleep until woken, at most ``SAMPLE_US``."""
        yield from self.sample()
        now_us: int = yield ReadTimer()
        yield Sleep(now_us + SAMPLE_US)

    def currents(self) -> dict[Monitor, float]:
        """Every monitor in mA, to 0.1 mA; for interrupt handlers too."""
        self._meter.charge(adc_conversion=len(Monitor), f32_mul=len(Monitor))
        return {
            monitor: round(self._hardware.adc_counts(monitor) * MA_PER_COUNT, 1)
            for monitor in Monitor
        }

    def clear_over_current(self, *memories: Sram) -> Routine[None]:
        """Clear the flags of ``memories`` and switch on those that were cut off."""
        cut = [sram for sram in memories if self._state.over_current[sram]]
        if not cut:
            return
        yield from self.watch_until(max(self._cut_us[sram] for sram in cut) + OFF_TIME_US)
        for sram in cut:
            yield from self._switch(sram, True)
            self._state.over_current[sram] = False
        yield from self.pause(SETTLE_US)

    def _switch(self, sram: Sram, on: bool) -> Routine[None]:
        yield SetPin(SRAM_POWER[sram], int(on))
        self._on[sram] = on

    def pause(self, us: int) -> Routine[None]:
        now_us: int = yield ReadTimer()
        yield from self.watch_until(now_us + us)
