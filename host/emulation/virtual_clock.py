"""Virtual time for drivers under test: their clocks and sleeps follow the emulated devices.

A driver that uses ``time.sleep`` and ``time.monotonic`` runs unmodified. The standard library,
pytest and this package keep wall time, as do all threads but the one that powered the device up.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cubestack.host.emulation.emulated import AnyEmulated

NS_PER_S = 10**9

LOOK_NS = 10_000
"""Virtual time per reading of the clock, so that a polling loop ends."""

KEEP_WALL_TIME = frozenset(
    sys.stdlib_module_names
    | {"cubestack", "pytest", "_pytest", "pluggy", "xdist", "execnet", "hypothesis", "_hypothesis"}
)
"""Top-level modules that keep wall time."""

CLOCKS: dict[str, Callable[[], int]] = {
    "monotonic": time.monotonic_ns,
    "perf_counter": time.perf_counter_ns,
    "time": time.time_ns,
}
"""Functions of ``time``, with their equivalents in ns."""

_sleep = time.sleep


class VirtualClock:
    """Replaces ``time`` for the code under test while ``follow`` is active.

    With several devices that have separate virtual times, the latest counts, and a sleep advances
    all of them.
    """

    def __init__(self) -> None:
        self._devices: dict[AnyEmulated, int] = {}
        self._elapsed_ns = 0
        self._began_ns: dict[str, int] = {}
        self._thread = 0
        self._instead: dict[int, Any] = {id(time.sleep): self._virtual_sleep()}
        for name in CLOCKS:
            for of_time in (name, f"{name}_ns"):
                self._instead[id(getattr(time, of_time))] = self._virtual_clock(of_time)
        self._replaced: list[tuple[Any, str, Any]] = []

    @contextmanager
    def follow(self, device: AnyEmulated) -> Iterator[None]:
        if not self._devices:
            self._thread = threading.get_ident()
            self._elapsed_ns = 0
            self._began_ns = {name: clock() for name, clock in CLOCKS.items()}
            self._replace()
        self._devices[device] = self._elapsed_ns - _now_ns(device)
        try:
            yield
        finally:
            self._elapsed()
            del self._devices[device]
            if not self._devices:
                self._restore()

    def _elapsed(self) -> int:
        """Elapsed ns since the first device; never decreases."""
        times = (_now_ns(device) + ahead for device, ahead in self._devices.items())
        self._elapsed_ns = max(self._elapsed_ns, *times)
        return self._elapsed_ns

    def _wait(self, seconds: float) -> None:
        for device in self._devices:
            device.wait(seconds)

    def _followed(self, caller: Any) -> bool:
        top = str(caller.f_globals.get("__name__")).partition(".")[0]
        return (
            bool(self._devices)
            and threading.get_ident() == self._thread
            and top not in KEEP_WALL_TIME
        )

    # A module imported meanwhile may keep these for ever, so each call checks whether to be
    # virtual.

    def _virtual_sleep(self) -> Callable[[float], None]:
        def sleep(seconds: float, /) -> None:
            if self._followed(sys._getframe(1)) and seconds >= 0:
                self._wait(seconds)
            else:
                _sleep(seconds)

        return sleep

    def _virtual_clock(self, of_time: str) -> Callable[[], float]:
        real, kind = getattr(time, of_time), of_time.removesuffix("_ns")
        scale = NS_PER_S if kind == of_time else 1

        def clock() -> float:
            if not self._followed(sys._getframe(1)):
                return real()  # type: ignore[no-any-return]
            self._wait(LOOK_NS / NS_PER_S)
            now_ns = self._began_ns[kind] + self._elapsed()
            return now_ns / scale if scale > 1 else now_ns

        return clock

    def _replace(self) -> None:
        """Replace functions of ``time``, there and in modules under test that imported them."""
        for module in list(sys.modules.values()):
            name = getattr(module, "__name__", "")
            if module is time or str(name).partition(".")[0] not in KEEP_WALL_TIME:
                for key, value in list(getattr(module, "__dict__", {}).items()):
                    if id(value) in self._instead:
                        self._replaced.append((module, key, value))
                        setattr(module, key, self._instead[id(value)])

    def _restore(self) -> None:
        for module, key, value in self._replaced:
            setattr(module, key, value)
        self._replaced.clear()


def _now_ns(device: AnyEmulated) -> int:
    return round(device.time_s * NS_PER_S)
