"""Supplies: switches of memories and cameras, current monitors, latch-up of a memory.

CubeSense thesis, section 3.2.1.1: a monitor and a switch for each memory, read by the converter. No
comparator watches, so the program looks: every few milliseconds while it waits, and after every
line that it reads. A memory that draws too much is cut at once and stays off until telecommand
ClearOverCurrent, because whatever it held is lost.
"""

from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware
from cubestack.firmware_model.cubesense.state import State
from cubestack.firmware_model.interface.cubesense.codes import Sram
from cubestack.firmware_model.interface.cubesense.pins import MA_PER_COUNT, SRAM_POWER, Monitor
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Routine, SetPin, Sleep

OVER_CURRENT_MA = 60.0
"""Assumed, no limit is published: four times what a working memory draws here (15 mA, and table 7.1
has some 5 mA at 5 V), and far below what a latch-up does."""

SAMPLE_US = 5_000
"""Longest time between two looks at the monitors while the program waits."""

OFF_TIME_US = 100_000
"""How long a supply stays off at least in a power cycle: assumed, the sources give no time."""

SETTLE_US = 1_000
"""From a supply's switch to its first use: assumed."""

_LIMIT_COUNTS = round(OVER_CURRENT_MA / MA_PER_COUNT)

_MONITORS = {Sram.SRAM1: Monitor.SRAM1, Sram.SRAM2: Monitor.SRAM2}


class Supply:
    """The memories' supplies, and everybody's monitors."""

    def __init__(self, hardware: CubeSenseHardware, meter: Meter, state: State) -> None:
        """Every switch is open, as at reset."""
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._on = dict.fromkeys(Sram, False)
        self._cut_us = dict.fromkeys(Sram, 0)

    def start(self) -> Routine[None]:
        """Switch both memories on."""
        for sram in Sram:
            yield from self._switch(sram, True)
        yield from self.pause(SETTLE_US)

    def available(self, sram: Sram) -> bool:
        """Whether ``sram`` is on."""
        return self._on[sram]

    def sample(self) -> Routine[None]:
        """Look at both memories that are on, and cut the one that draws too much."""
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
        """Wait, and keep an eye on the memories."""
        while True:
            yield from self.sample()
            now_us: int = yield ReadTimer()
            if now_us >= deadline_us:
                return
            yield Sleep(min(deadline_us, now_us + SAMPLE_US), wakeable=False)

    def idle(self) -> Routine[None]:
        """Look at the memories and sleep until woken, but not for long."""
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
        """Clear the flags of ``memories`` and switch on again what was cut; another one stays."""
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
        """Wait for ``us`` as ``watch_until`` does."""
        now_us: int = yield ReadTimer()
        yield from self.watch_until(now_us + us)
