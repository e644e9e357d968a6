import queue
import sys
import threading
import time
from types import ModuleType
from typing import Any

import pytest

from cubestack.host.emulation.virtual_clock import (
    CLOCKS,
    KEEP_WALL_TIME,
    LOOK_NS,
    NS_PER_S,
    VirtualClock,
)

REAL = {name: getattr(time, name) for name in ("sleep", *CLOCKS, *(f"{one}_ns" for one in CLOCKS))}


class FakeDevice:
    def __init__(self, time_s: float = 0.0) -> None:
        self.time_s = time_s

    def wait(self, seconds: float) -> None:
        self.time_s += seconds


DRIVER = """
import time as t
from time import sleep as nap, monotonic

def poll(done):
    end = monotonic() + 3600
    while monotonic() < end:
        if done():
            return True
        nap(0.1)
    return False

def spin(seconds):
    end = t.perf_counter_ns() + round(seconds * 1e9)
    looks = 0
    while t.perf_counter_ns() < end:
        looks += 1
    return looks

clocks = [t.time, t.monotonic, t.perf_counter]
"""


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A module that imported names from ``time`` before the device was opened."""
    module = ModuleType("driver_under_test")
    exec(DRIVER, module.__dict__)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return module


@pytest.fixture
def clock() -> Any:
    return VirtualClock()


def test_poll_loop_of_an_hour_takes_virtual_time(clock: Any, driver: Any) -> None:
    device, began_s = FakeDevice(5.0), time.monotonic()
    with clock.follow(device):
        assert not driver.poll(lambda: False)
        assert device.time_s == pytest.approx(3605, abs=0.2)
        assert driver.poll(lambda: device.time_s > 3700)
        assert device.time_s == pytest.approx(3700, abs=0.2)
    assert time.monotonic() - began_s < 60


def test_polling_loop_ends_as_virtual_time_advances(clock: Any, driver: Any) -> None:
    device = FakeDevice()
    with clock.follow(device):
        looks = driver.spin(0.1)
    assert looks == pytest.approx(0.1 * NS_PER_S / LOOK_NS, abs=2)
    assert device.time_s == pytest.approx(0.1, abs=3e-5)


def test_all_clocks_show_virtual_time(clock: Any) -> None:
    with clock.follow(FakeDevice(7.0)):
        began = [getattr(time, name)() for name in CLOCKS]
        assert began == pytest.approx([real() / NS_PER_S for real in CLOCKS.values()], abs=5)
        time.sleep(1000)
        gone = [getattr(time, name)() - since for name, since in zip(CLOCKS, began, strict=True)]
        assert gone == pytest.approx([1000] * 3, abs=1e-3)
        at_ns = time.monotonic_ns()
        assert isinstance(at_ns, int)
        assert at_ns / NS_PER_S == pytest.approx(time.monotonic(), abs=1e-4)


def test_clock_of_several_devices_is_monotonic(clock: Any) -> None:
    one, other = FakeDevice(100.0), FakeDevice(3.0)
    with clock.follow(one), clock.follow(other):
        began_s = time.monotonic()
        other.wait(50)  # as an answer on its line does
        assert time.monotonic() - began_s == pytest.approx(50, abs=1e-3)
        one.wait(20)
        assert time.monotonic() - began_s == pytest.approx(50, abs=1e-3)
        time.sleep(1)
        assert (one.time_s, other.time_s) == pytest.approx((121, 54), abs=1e-3)
    with clock.follow(one):
        between_s = time.monotonic()
        with clock.follow(FakeDevice()):
            time.sleep(10)
        assert time.monotonic() - between_s == pytest.approx(10, abs=1e-3)


def test_other_modules_and_threads_keep_wall_time(clock: Any, driver: Any) -> None:
    device = FakeDevice()
    with clock.follow(device):
        began_s = REAL["monotonic"]()
        for name in ("asyncio.events", "cubestack.emulator", "_pytest.runner"):
            assert name.partition(".")[0] in KEEP_WALL_TIME
            own = {"__name__": name, "time": time}
            assert eval("time.monotonic()", own) == pytest.approx(began_s, abs=5)
            eval("time.sleep(0.001)", own)
        with pytest.raises(queue.Empty):
            queue.Queue[int]().get(timeout=0.001)
        thread = threading.Thread(target=driver.nap, args=(0.001,))
        thread.start()
        thread.join()
        assert device.time_s == 0
        assert REAL["monotonic"]() - began_s >= 0.005


def test_leaving_virtual_time_restores_the_clocks(clock: Any, driver: Any) -> None:
    own = dict(vars(driver))
    with clock.follow(FakeDevice()):
        from time import sleep as kept

        assert kept is not REAL["sleep"]
        assert driver.nap is kept
        with pytest.raises(ValueError, match="non-negative"):
            kept(-1)
    assert vars(driver) == own
    assert {name: getattr(time, name) for name in REAL} == REAL
    began_s = time.monotonic()
    kept(0.002)
    assert time.monotonic() - began_s >= 0.002
