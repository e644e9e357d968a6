"""Supply currents, load switches, latch-up and the comparators that watch for it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import simpy

from cubestack.emulator.sim.virtual_time import PS_PER_S, PS_PER_US, Kernel

COMPARATOR_US = 2
"""Response time of monitor and comparator: assumed."""


@dataclass(frozen=True)
class Part:
    """A component that draws current.

    Attributes:
        channel: load switch of its supply; None for the unswitched supply.
        ma: current in mA by state; the first one is the initial state.
    """

    channel: str | None
    ma: Mapping[str, float]


@dataclass(frozen=True)
class PowerTable:
    """A board's supplies.

    Attributes:
        volts: supply voltage for the currents.
        parts: by name.
        channels: trip current in mA of each load switch's comparator; None without a comparator.
    """

    volts: float
    parts: Mapping[str, Part]
    channels: Mapping[str, float | None]


class PowerModel:
    """Sums the currents of the parts; only the firmware switches a channel off.

    Attributes:
        on_overcurrent: interrupt: the comparator of a channel tripped.
        on_switch: called with (channel, on) when a load switch changed.
        on_change: called after a current may have changed.
    """

    def __init__(self, env: Kernel, table: PowerTable) -> None:
        self._env = env
        self.table = table
        self._states = {name: next(iter(part.ma)) for name, part in table.parts.items()}
        self._on = dict.fromkeys(table.channels, True)
        self._latch_up_ma = dict.fromkeys(table.channels, 0.0)
        self._failed: dict[str, float] = {}
        self._currents: dict[str | None, float] = {}  # since the latest change, as far as needed
        self._tripped = dict.fromkeys(table.channels, False)
        self._charge_ma_ps = 0.0
        self._since_ps = env.now
        self.on_overcurrent: Callable[[str], None] = lambda _channel: None
        self.on_switch: Callable[[str, bool], None] = lambda _channel, _on: None
        self.on_change: Callable[[], None] = lambda: None

    def set_state(self, part: str, state: str) -> None:
        """Change the state of a part; ValueError for names that are not in the table."""
        parts = self.table.parts
        if part not in parts:
            raise ValueError(f"no supplied part {part!r}, only {sorted(parts)}")
        if state not in parts[part].ma:
            raise ValueError(f"{part} has no state {state!r}, only {sorted(parts[part].ma)}")
        self._integrate()
        if self._states[part] != state:
            self._states[part] = state
            for affected in (None, parts[part].channel):
                self._currents.pop(affected, None)
        self._compare()

    def switch(self, channel: str, on: bool) -> None:
        """Set a load switch; switching off also ends a latch-up behind it."""
        self._check_channel(channel)
        if self._on[channel] == on:
            return
        self._integrate()
        self._on[channel] = on
        self._latch_up_ma[channel] = self._failed.get(channel, 0.0) if on else 0.0
        self._currents.clear()
        self._compare()
        self.on_switch(channel, on)

    def is_on(self, channel: str) -> bool:
        self._check_channel(channel)
        return self._on[channel]

    def latch_up(self, channel: str, extra_ma: float = 300.0, *, lasting: bool = False) -> None:
        """Simulate a particle strike: ``channel`` draws ``extra_ma`` more until switched off.

        A ``lasting`` latch-up returns each time the channel is switched on. A channel that is off
        is not affected otherwise.
        """
        self._check_channel(channel)
        if lasting:
            self._failed[channel] = extra_ma
        if self._on[channel]:
            self._integrate()
            self._latch_up_ma[channel] = extra_ma
            self._currents.clear()
            self._compare()

    def current_ma(self, channel: str | None = None) -> float:
        """Current of ``channel``, or of the whole stack, in mA."""
        known = self._currents.get(channel)
        if known is None:
            known = self._currents[channel] = self._sum_ma(channel)
        return known

    def _sum_ma(self, channel: str | None) -> float:
        if channel is not None:
            self._check_channel(channel)
        total = 0.0
        for name, part in self.table.parts.items():
            if channel in (None, part.channel) and (part.channel is None or self._on[part.channel]):
                total += part.ma[self._states[name]]
        latched = self._latch_up_ma
        return total + (sum(latched.values()) if channel is None else latched[channel])

    def charge_mas(self) -> float:
        """Charge drawn since the start, in mA s."""
        self._integrate()
        return self._charge_ma_ps / PS_PER_S

    def _integrate(self) -> None:
        self._charge_ma_ps += self.current_ma() * (self._env.now - self._since_ps)
        self._since_ps = self._env.now

    def _compare(self) -> None:
        for channel, limit in self.table.channels.items():
            above = limit is not None and self.current_ma(channel) > limit
            if above and not self._tripped[channel]:
                self._env.process(self._interrupt(channel))
            self._tripped[channel] = above
        self.on_change()

    def _interrupt(self, channel: str) -> simpy.events.ProcessGenerator:
        yield self._env.timeout(COMPARATOR_US * PS_PER_US)
        if self._tripped[channel]:
            self.on_overcurrent(channel)

    def _check_channel(self, channel: str) -> None:
        if channel not in self.table.channels:
            raise ValueError(f"no supply channel {channel!r}, only {sorted(self.table.channels)}")
