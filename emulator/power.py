"""Supply currents, load switches, latch-up and the comparators that watch for it.

CubeStar thesis, sections 5.2.3 and 6.3, table 6.2. The published currents are those of the whole
stack at 3.3 V in four modes. The split into parts is fitted to them, with two parts known
otherwise: the two LEDs (396.2 mW less 350 mW), and the processor's 200 uA/MHz running and
50 uA/MHz asleep (appendix E).
"""

from collections.abc import Callable

import simpy

from cubestack.emulator.virtual_time import PS_PER_S, PS_PER_US, Kernel

__all__ = ["CHANNELS", "PARTS", "SUPPLY_VOLTS", "PowerModel"]

SUPPLY_VOLTS = 3.3
COMPARATOR_US = 2
"""Response time of monitor and comparator: assumed."""

#: part: (supply channel or None for the unswitched supply, current in mA by state).
PARTS: dict[str, tuple[str | None, dict[str, float]]] = {
    "leds": (None, {"on": 14.0}),  # published: 46.2 mW
    "processor": (None, {"sleep": 2.4, "run": 9.6}),  # datasheet: 48 MHz
    "memory": ("memory", {"standby": 2.0, "transfer": 3.0}),  # assumed share
    "imager": ("imager", {"disabled": 42.8, "enabled": 92.8}),  # fitted: mode 2 less mode 1
    # Fitted: mode 3 less mode 2 and mode 4 less mode 1, less the running processor and memory.
    "fpga": ("imager", {"standby": 10.0, "storing": 58.9, "reading": 12.41}),
}

#: Trip current of each channel's comparator in mA, assumed: a third above the highest regular one
#: for the boards with imager and FPGA, ten times it for the memory, which draws little.
CHANNELS = {"memory": 30.0, "imager": 200.0}


class PowerModel:
    """Sums what the parts draw, and cuts off a channel only when the firmware says so.

    Attributes:
        on_overcurrent: interrupt: the comparator of a channel tripped.
        on_switch: told (channel, on) when a load switch changed.
    """

    def __init__(self, env: Kernel) -> None:
        """Start with every part in its first state and both switches on."""
        self._env = env
        self._states = {part: next(iter(states)) for part, (_, states) in PARTS.items()}
        self._on = dict.fromkeys(CHANNELS, True)
        self._latch_up_ma = dict.fromkeys(CHANNELS, 0.0)
        self._tripped = dict.fromkeys(CHANNELS, False)
        self._charge_ma_ps = 0.0
        self._since_ps = env.now
        self.on_overcurrent: Callable[[str], None] = lambda _channel: None
        self.on_switch: Callable[[str, bool], None] = lambda _channel, _on: None

    def set_state(self, part: str, state: str) -> None:
        """Part ``part`` is in ``state`` from now on (names of ``PARTS``, else ValueError)."""
        if part not in PARTS:
            raise ValueError(f"no supplied part {part!r}, only {sorted(PARTS)}")
        if state not in PARTS[part][1]:
            raise ValueError(f"{part} has no state {state!r}, only {sorted(PARTS[part][1])}")
        self._integrate()
        self._states[part] = state
        self._compare()

    def switch(self, channel: str, on: bool) -> None:
        """Turn a load switch; turning it off also ends a latch-up behind it."""
        _check_channel(channel)
        if self._on[channel] == on:
            return
        self._integrate()
        self._on[channel] = on
        self._latch_up_ma[channel] = 0.0
        self._compare()
        self.on_switch(channel, on)

    def latch_up(self, channel: str, extra_ma: float = 300.0) -> None:
        """A particle strike: ``channel`` draws ``extra_ma`` more until it is switched off.

        Nothing happens to a channel that is off.
        """
        _check_channel(channel)
        if self._on[channel]:
            self._integrate()
            self._latch_up_ma[channel] = extra_ma
            self._compare()

    def current_ma(self, channel: str | None = None) -> float:
        """Current of ``channel``, or of the whole stack, in mA."""
        if channel is not None:
            _check_channel(channel)
        total = 0.0
        for part, (supply, states) in PARTS.items():
            if channel in (None, supply) and (supply is None or self._on[supply]):
                total += states[self._states[part]]
        return total + sum(
            extra for name, extra in self._latch_up_ma.items() if channel in (None, name)
        )

    def charge_mas(self) -> float:
        """Charge drawn since the start, in mA s."""
        self._integrate()
        return self._charge_ma_ps / PS_PER_S

    def _integrate(self) -> None:
        self._charge_ma_ps += self.current_ma() * (self._env.now - self._since_ps)
        self._since_ps = self._env.now

    def _compare(self) -> None:
        for channel, limit in CHANNELS.items():
            above = self.current_ma(channel) > limit
            if above and not self._tripped[channel]:
                self._env.process(self._interrupt(channel))
            self._tripped[channel] = above

    def _interrupt(self, channel: str) -> simpy.events.ProcessGenerator:
        yield self._env.timeout(COMPARATOR_US * PS_PER_US)
        if self._tripped[channel]:
            self.on_overcurrent(channel)


def _check_channel(channel: str) -> None:
    if channel not in CHANNELS:
        raise ValueError(f"no supply channel {channel!r}, only {sorted(CHANNELS)}")
