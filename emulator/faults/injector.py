"""Injects faults into a board: at once or at a virtual time, for a while or for ever."""

from collections.abc import Callable
from typing import Any, Protocol, cast

from cubestack.emulator.faults.declaration import Fault, FaultError, Site
from cubestack.emulator.faults.injection import FaultEvent, Injection
from cubestack.emulator.faults.parts import CameraFaults, MemoryFaults, RegisterFaults, SupplyFaults
from cubestack.emulator.faults.pins import PinFaults
from cubestack.emulator.faults.plan import Plan
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.faults.table import (
    FAULTS,
    MemoryStuck,
    RegisterFlip,
    RegisterUpsets,
    make_fault,
)
from cubestack.emulator.faults.wire import BusFaults, LineFaults
from cubestack.emulator.sim.virtual_time import PS_PER_S

LOG_LIMIT = 100_000
"""Events kept in the log; all are counted."""

LONGEST_S = 1e9
"""Latest time and longest duration."""


class _Mechanism(Protocol):
    """What carries out the faults of one target."""

    def prepare(self, injection: Injection) -> None: ...

    def begin(self, injection: Injection) -> None: ...

    def end(self, injection: Injection) -> None: ...


class Faults:
    """A board's faults. What is not hit is not touched: nothing is in the way before.

    Attributes:
        seed: of everything random about faults that are injected from now on.
        log: what faults did, in the order in which it came out, at most ``LOG_LIMIT`` events.
        events: how many events there were.
        on_event: told about each one.
    """

    def __init__(self, sites: Sites, seed: int = 0) -> None:
        """Act on a board's ``sites``."""
        self._sites = sites
        self._env = sites.kernel
        self._mechanisms: dict[tuple[str, str], _Mechanism] = {}
        self._running: list[Injection] = []
        self._began: set[int] = set()
        self._count = 0
        self.seed = seed
        self.log: list[FaultEvent] = []
        self.events = 0
        self.on_event: Callable[[FaultEvent], None] = lambda _event: None

    def targets(self, site: Site) -> tuple[str, ...]:
        """Names of what faults of that site can hit here, the usual one first."""
        return self._sites.targets(site)

    def kinds(self) -> dict[str, tuple[str, ...]]:
        """Kinds that can be injected here, with their targets, the usual one first."""
        engine = self._sites.engine
        refused: set[type[Fault]] = set()
        if engine is None:
            refused.add(MemoryStuck)
        elif not engine.registers:
            refused |= {RegisterFlip, RegisterUpsets}
        return {
            kind: self.targets(fault.site)
            for kind, fault in FAULTS.items()
            if fault not in refused and self.targets(fault.site)
        }

    def inject(
        self,
        fault: Fault | str,
        *,
        target: str | None = None,
        at_s: float | None = None,
        for_s: float | None = None,
        **parameters: object,
    ) -> Injection:
        """Inject ``fault``: one of the table, or the kind of one and its ``parameters``.

        Args:
            fault: what happens.
            target: where; the first one of ``targets`` unless given.
            at_s: virtual time since power-up; now unless given.
            for_s: how long; until it is cleared unless given.
            parameters: of a kind.

        Raises:
            FaultError: no such fault, parameter or target, or a time that is over.
            ValueError: no such register, or none that the engine can turn over.
        """
        if isinstance(fault, str):
            fault = make_fault(fault, **parameters)
        elif parameters:
            raise FaultError(f"{fault.kind} has its parameters: leave {', '.join(parameters)} out")
        target = self._target(fault, target)
        start_ps, end_ps = self._times(fault, at_s, for_s)
        injection = Injection(self._count, fault, target, start_ps, end_ps, self.seed)
        mechanism = self._mechanism(fault.site, target)
        mechanism.prepare(injection)
        self._count += 1
        self._running.append(injection)
        if start_ps == self._env.now:
            self._begin(injection, mechanism)
        if start_ps > self._env.now or end_ps is not None:
            self._env.process(self._follow(injection, mechanism))
        return injection

    def load(self, plan: Plan) -> list[Injection]:
        """Take over a plan's seed and inject its faults; the same errors as ``inject``."""
        self.seed = plan.seed
        injections = []
        for number, planned in enumerate(plan.faults, start=1):
            try:
                injections.append(
                    self.inject(
                        planned.fault, target=planned.target, at_s=planned.at_s, for_s=planned.for_s
                    )
                )
            except ValueError as error:
                raise FaultError(f"{plan.name}: fault {number}: {error}") from None
        return injections

    def clear(self, injection: Injection | None = None) -> None:
        """End an injected fault now, or all of them."""
        for running in [injection] if injection is not None else list(self._running):
            if running in self._running:
                running.end_ps = self._env.now
                self._end(running, self._mechanism(running.fault.site, running.target))

    def report(self, time_ps: int, injection: Injection, text: str) -> None:
        """Log what a fault did."""
        injection.hits += 1
        event = FaultEvent(time_ps, injection.fault.kind, injection.target, text)
        self.events += 1
        if len(self.log) < LOG_LIMIT:
            self.log.append(event)
        self.on_event(event)

    def _target(self, fault: Fault, target: str | None) -> str:
        targets = self.targets(fault.site)
        if not targets:
            raise FaultError(f"{fault.kind}: this device has no {fault.site.value} to hit")
        if target is None:
            return targets[0]
        if target not in targets:
            names = ", ".join(targets)
            raise FaultError(f"{fault.kind}: no {fault.site.value} {target!r}; there are {names}")
        return target

    def _times(
        self, fault: Fault, at_s: float | None, for_s: float | None
    ) -> tuple[int, int | None]:
        now_ps = self._env.now
        start_ps = now_ps
        if at_s is not None:
            if not now_ps / PS_PER_S <= at_s <= LONGEST_S:
                raise FaultError(
                    f"{fault.kind}: it can not begin at {at_s:g} s, it is {now_ps / PS_PER_S:g} s"
                )
            start_ps = max(now_ps, round(at_s * PS_PER_S))
        if for_s is None:
            return start_ps, None
        if fault.momentary:
            raise FaultError(f"{fault.kind} happens at one instant: it has no duration")
        if not 0 < for_s <= LONGEST_S:
            raise FaultError(f"{fault.kind}: a duration must be over 0 s, not {for_s:g} s")
        return start_ps, start_ps + max(1, round(for_s * PS_PER_S))

    def _follow(self, injection: Injection, mechanism: _Mechanism) -> Any:
        if injection.start_ps > self._env.now:
            yield self._env.timeout(injection.start_ps - self._env.now)
            if injection not in self._running:
                return
            self._begin(injection, mechanism)
        if injection.end_ps is not None:
            yield self._env.timeout(injection.end_ps - self._env.now)
            if injection in self._running:
                self._end(injection, mechanism)

    def _begin(self, injection: Injection, mechanism: _Mechanism) -> None:
        self._began.add(injection.number)
        mechanism.begin(injection)
        if injection.fault.momentary:
            self._running.remove(injection)
            self._began.discard(injection.number)

    def _end(self, injection: Injection, mechanism: _Mechanism) -> None:
        self._running.remove(injection)
        self._began.discard(injection.number)
        mechanism.end(injection)

    def _mechanism(self, site: Site, target: str) -> _Mechanism:
        # All pins of the FPGA are one mechanism: only one can stand before the processor.
        group = "pins" if site in (Site.ACKNOWLEDGE, Site.CONTROL) else site.name
        key = group, "" if group == "pins" else target
        if key not in self._mechanisms:
            self._mechanisms[key] = self._make(site, target)
        return self._mechanisms[key]

    def _make(self, site: Site, target: str) -> _Mechanism:
        sites, env, engine = self._sites, self._env, self._sites.engine
        match site:
            case Site.UART:
                return LineFaults(env, sites.uarts[target], self.report)
            case Site.I2C:
                return BusFaults(env, sites.buses[target], self.report)
            case Site.SUPPLY:
                return SupplyFaults(env, sites.supplies, self.report)
            case Site.MEMORY:
                pins = None if engine is None else self._pins()
                memory = sites.all_memories()[target]
                return MemoryFaults(env, memory, engine, pins, self.report)
        assert engine is not None
        match site:
            case Site.CAMERA:
                camera = sites.cameras[target]
                return CameraFaults(env, engine, target, camera, sites.supplies, self.report)
            case Site.FPGA:
                return RegisterFaults(env, engine, self.report)
            case _:
                return PinFaults.placed(sites, self.report)

    def _pins(self) -> PinFaults:
        return cast(PinFaults, self._mechanism(Site.CONTROL, ""))
