"""Injects faults into a board, at once or at a virtual time, for a duration or permanently."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

from cubestack.emulator.faults import parts, table
from cubestack.emulator.faults.declaration import TIMES, Fault, FaultError, Site
from cubestack.emulator.faults.injection import FaultEvent, Injection, Mechanism
from cubestack.emulator.faults.pins import PinFaults
from cubestack.emulator.faults.plan import Plan
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.faults.wire import BusFaults, LineFaults
from cubestack.emulator.sim.virtual_time import PS_PER_S

LOG_LIMIT = 100_000
"""Limit of the events stored in the log."""


class Faults:
    """A board's faults. A target without faults is unchanged: its mechanism is created when needed.

    Attributes:
        seed: seed of the faults that are injected from now on.
        log: effects of faults, in the order of their reports, at most ``LOG_LIMIT``.
        events: number of all effects.
        on_event: called with each one.
    """

    def __init__(self, sites: Sites, seed: int = 0) -> None:
        self._sites = sites
        self._env = sites.kernel
        self._mechanisms: dict[tuple[Site, str], Mechanism] = {}
        self._running: list[Injection] = []
        self._count = 0
        self.seed = seed
        self.log: list[FaultEvent] = []
        self.events = 0
        self.on_event: Callable[[FaultEvent], None] = lambda _event: None

    def targets(self, site: Site) -> tuple[str, ...]:
        """Targets of faults at ``site`` on this board, the default first."""
        return self._sites.targets(site)

    def kinds(self) -> dict[str, tuple[str, ...]]:
        """Kinds of faults that this board can have, with their targets, the default first."""
        engine = self._sites.engine
        refused: set[type[Fault]] = set()
        if engine is None:
            refused.add(table.MemoryStuck)
        elif not engine.registers:
            refused |= {table.RegisterFlip, table.RegisterUpsets}
        return {
            kind: self.targets(fault.site)
            for kind, fault in table.FAULTS.items()
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
        """Inject ``fault``: an instance, or a kind with its ``parameters``.

        Args:
            fault: fault or kind.
            target: default: the first one of ``targets``.
            at_s: virtual time since power-up; default: now.
            for_s: duration; default: until it is cleared.
            parameters: parameters of the kind.

        Raises:
            FaultError: unknown kind, parameter or target, or a time in the past.
            ValueError: unknown register, or an engine without access to registers.
        """
        if isinstance(fault, str):
            fault = table.make_fault(fault, **parameters)
        elif parameters:
            raise FaultError(f"{fault.kind} already has parameters; omit {', '.join(parameters)}")
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

    def inject_words(self, words: Sequence[str]) -> Injection:
        """Parse and inject ``KIND [TARGET] [PARAMETER=VALUE ...] [at_s=S] [for_s=S]``."""
        kind, *rest = words
        given = dict(word.split("=", 1) for word in rest if "=" in word)
        targets = [word for word in rest if "=" not in word]
        if "target" in given:
            targets.append(given.pop("target"))
        if len(targets) > 1:
            raise FaultError(f"fault {kind}: one target, not {' '.join(targets)}")
        declared = {**(table.FAULTS[kind].declared() if kind in table.FAULTS else {}), **TIMES}
        values: dict[str, Any] = dict(given)
        for name in given.keys() & declared.keys():
            try:
                values[name] = declared[name].parse(given[name])
            except ValueError as error:
                raise FaultError(f"{kind}: {name} {error}") from None
        times = {name: values.pop(name) for name in TIMES if name in values}
        return self.inject(
            table.make_fault(kind, **values), target=next(iter(targets), None), **times
        )

    def load(self, plan: Plan) -> list[Injection]:
        """Use a plan's seed and inject its faults; errors as for ``inject``."""
        self.seed = plan.seed
        injections = []
        for number, planned in enumerate(plan.faults, start=1):
            try:
                injection = self.inject(
                    planned.fault, target=planned.target, at_s=planned.at_s, for_s=planned.for_s
                )
            except ValueError as error:
                raise FaultError(f"{plan.name}: fault {number}: {error}") from None
            injections.append(injection)
        return injections

    def clear(self, injection: Injection | None = None) -> None:
        """End an injected fault now, by default all."""
        for running in [injection] if injection is not None else list(self._running):
            if running in self._running:
                running.end_ps = self._env.now
                self._end(running, self._mechanism(running.fault.site, running.target))

    def report(self, time_ps: int, injection: Injection, text: str) -> None:
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
            raise FaultError(f"{fault.kind}: unknown {fault.site.value} {target!r}; known: {names}")
        return target

    def _times(
        self, fault: Fault, at_s: float | None, for_s: float | None
    ) -> tuple[int, int | None]:
        now_ps = self._env.now
        declared = {"at_s": replace(TIMES["at_s"], low=now_ps / PS_PER_S), "for_s": TIMES["for_s"]}
        for name, value in (("at_s", at_s), ("for_s", for_s)):
            try:
                declared[name].check(value)
            except ValueError as error:
                raise FaultError(f"{fault.kind}: {name} {error}") from None
        start_ps = now_ps if at_s is None else max(now_ps, round(at_s * PS_PER_S))
        if for_s is None:
            return start_ps, None
        if fault.momentary:
            raise FaultError(f"{fault.kind} happens at one instant; omit for_s")
        return start_ps, start_ps + max(1, round(for_s * PS_PER_S))

    def _follow(self, injection: Injection, mechanism: Mechanism) -> Any:
        if injection.start_ps > self._env.now:
            yield self._env.timeout(injection.start_ps - self._env.now)
            if injection not in self._running:
                return
            self._begin(injection, mechanism)
        if injection.end_ps is not None:
            yield self._env.timeout(injection.end_ps - self._env.now)
            if injection in self._running:
                self._end(injection, mechanism)

    def _begin(self, injection: Injection, mechanism: Mechanism) -> None:
        mechanism.begin(injection)
        if injection.fault.momentary:
            self._running.remove(injection)

    def _end(self, injection: Injection, mechanism: Mechanism) -> None:
        self._running.remove(injection)
        mechanism.end(injection)

    def _mechanism(self, site: Site, target: str) -> Mechanism:
        if (site, target) not in self._mechanisms:
            self._mechanisms[site, target] = self._make(site, target)
        return self._mechanisms[site, target]

    def _make(self, site: Site, target: str) -> Mechanism:
        sites, engine, who = self._sites, self._sites.engine, (self._env, self.report)
        match site:
            case Site.UART:
                return LineFaults(*who, sites.uarts[target])
            case Site.I2C:
                return BusFaults(*who, sites.buses[target])
            case Site.SUPPLY:
                return parts.SupplyFaults(*who, sites.supplies)
            case Site.PROCESSOR:
                return parts.ProcessorFaults(*who, sites.resets[target])
            case Site.MEMORY:
                pins = None if engine is None else (lambda: self._pins)
                changed = partial(sites.changed, target)
                memory = sites.all_memories()[target]
                return parts.MemoryFaults(*who, memory, engine, pins, changed)
            case Site.CORE:
                assert sites.core is not None
                return parts.CoreFaults(*who, sites.core)
        assert engine is not None
        match site:
            case Site.CAMERA:
                return parts.CameraFaults(
                    *who, engine, target, sites.cameras[target], sites.supplies
                )
            case Site.FPGA:
                return parts.RegisterFaults(*who, engine)
            case _:
                return self._pins

    @cached_property
    def _pins(self) -> PinFaults:
        """Mechanism of all pins of the FPGA: the processor has only one FPGA port."""
        assert self._sites.engine is not None
        self._sites.processor.fpga = pins = PinFaults(
            *(self._env, self.report, self._sites.engine, self._sites.engine.wiring.data),
            self._sites.fpgas,
        )
        return pins
