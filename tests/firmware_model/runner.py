"""Runs firmware programs without an emulator: performs their requests in virtual time.

A request is performed as a whole; only a sleep can be left half-way, so that a test can do
something at any time of it. A subclass simulates the devices on the pins: set_pin, get_pin,
await_pin, strobe, access and transfer, as far as its programs use them.
"""

from collections.abc import Callable
from typing import Any, TypeVar

from cubestack.firmware_model.mcu import requests
from cubestack.firmware_model.mcu.costs import CostTable, Meter

T = TypeVar("T")


class Runner:
    """Virtual time, and the requests that every program makes."""

    boot_us = 0
    hang_us = 1_000_000_000

    def __init__(self, table: CostTable) -> None:
        self.meter = Meter(table)  #: what the program is charged
        self.now_ns = 0  #: virtual time
        self.resets: list[int] = []  #: causes of all resets
        #: log: (time in us, request) of every request but those that only take time
        self.log: list[tuple[int, requests.Request]] = []
        #: on_request: called with every request before it is performed
        self.on_request: Callable[[requests.Request], object] = lambda _request: None
        #: on_sleep: called when a routine that runs by itself waits to be woken, before time passes
        self.on_sleep: Callable[[], object] = lambda: None
        self._woken = False

    # --- what the program uses --------------------------------------------------------------------

    def wake(self) -> None:
        self._woken = True

    def uptime_us(self) -> int:
        return self.now_us

    # --- what a test uses -------------------------------------------------------------------------

    @property
    def now_us(self) -> int:
        """Virtual time in us; the timer of the program."""
        return self.now_ns // 1000

    @now_us.setter
    def now_us(self, now_us: int) -> None:
        self.now_ns = 1000 * now_us

    def run(self, until_us: int | None = None) -> None:
        hang_us = self.now_us + self.hang_us
        while until_us is None or self.now_us < until_us:
            assert self.now_us < hang_us, f"still busy: {self._request}"
            if self._request is None:
                self._request = self._routine.send(self._answer)
                self._pay()
                self.on_request(self._request)
            if isinstance(self._request, requests.Reset):
                self.resets.append(self._request.cause)
                self._boot()
                continue
            if isinstance(self._request, requests.Sleep):
                if not self._slept(self._request, until_us):
                    return
            else:
                self._answer = self._perform(self._request)
            self._request = None

    def perform(self, routine: requests.Routine[T]) -> T:
        """Run a routine by itself, to its end; what it returns."""
        answer: Any = None
        while True:
            try:
                request = routine.send(answer)
            except StopIteration as end:
                self._pay()
                result: T = end.value
                return result
            self._pay()
            self.on_request(request)
            if isinstance(request, requests.Sleep):
                if request.wakeable:
                    self.on_sleep()
                answer = request.wakeable and self._woken
                self._woken = self._woken and not answer
                if not answer:
                    assert request.deadline_us is not None
                    self.now_ns = max(self.now_ns, 1000 * request.deadline_us)
            else:
                answer = self._perform(request)

    # --- what a subclass has -------------------------------------------------------------------

    def start(self) -> requests.Routine[None]:
        raise AssertionError("there is no whole program here")

    @property
    def waiting(self) -> bool:
        return False

    # --- time -------------------------------------------------------------------------------------

    def _boot(self) -> None:
        self.now_ns += 1000 * self.boot_us
        self._woken = False
        self._request: requests.Request | None = None
        self._answer: object = None
        self._routine = self.start()

    def _pay(self) -> None:
        self.now_ns += self.meter.take() * 1_000_000_000 // self.meter.table.clock_hz

    def _perform(self, request: requests.Request) -> object:
        if not isinstance(request, requests.Pay | requests.ReadTimer):
            self.log.append((self.now_us, request))
        match request:
            case requests.ReadTimer():
                return self.now_us
            case requests.SetPin(pin, level):
                self.meter.charge(port_write=1)
                self.set_pin(pin, level)
            case requests.ReadPin(pin):
                self.meter.charge(port_read=1)
                return self.get_pin(pin)
            case requests.AwaitPin():
                return self.await_pin(request)
            case requests.StrobeRead():
                self.strobe(request)
            case requests.BusAccess():
                return self.access(request)
            case requests.CameraTransfer():
                return self.transfer(request)
        return None

    def _slept(self, request: requests.Sleep, until_us: int | None) -> bool:
        """Sleep as far as it goes; False when something else has to happen first."""
        woken = request.wakeable and self._woken
        deadline_us = self.now_us if woken else request.deadline_us
        if until_us is None and (deadline_us is None or (not woken and self.waiting)):
            return False
        if until_us is not None and (deadline_us is None or deadline_us > until_us):
            self.now_us = until_us
            return False
        assert deadline_us is not None
        self.now_ns = max(self.now_ns, 1000 * deadline_us)
        self._woken = self._woken and not woken
        self._answer = woken
        return True
