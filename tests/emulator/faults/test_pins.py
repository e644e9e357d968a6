"""A processor that waits for an acknowledge about which any faults lie: it never waits for ever."""

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from cubestack.emulator.faults.injection import Injection
from cubestack.emulator.faults.pins import PinFaults
from cubestack.emulator.faults.table import AckLate, AckLost, AckStuck
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.mcu.requests import AwaitPin

ROSE_US, TIMEOUT_US = 40, 200
MOST_BURSTS = 100

FAULTS = st.lists(
    st.builds(AckLate, delay_us=st.sampled_from([0, 10, 60, 500]))
    | st.builds(AckLost)
    | st.builds(AckStuck, level=st.integers(0, 1)),
    max_size=4,
)


def sees(faults) -> bool:
    """Whether the processor sees the rise in time: the last that holds a level decides."""
    stuck = [fault.level for fault in faults if isinstance(fault, AckStuck)]
    if stuck:
        return bool(stuck[-1])
    if any(isinstance(fault, AckLost) for fault in faults):
        return False
    delays = [fault.delay_us for fault in faults if isinstance(fault, AckLate)]
    return ROSE_US + max(delays, default=0) <= TIMEOUT_US


@pytest.fixture
def waiting(desk_of):
    """A processor with such faults; what it has seen in the end."""

    def wait(faults):
        def body(desk):
            desk.note((yield AwaitPin("ACK", 1, TIMEOUT_US, poll_cycles=1)))

        desk = desk_of(body)
        desk.ack_at(ROSE_US)
        pins = PinFaults(desk.kernel, lambda _time_ps, _injection, _text: None, desk.engine)
        desk.processor.fpga = pins
        for number, fault in enumerate(faults):
            pins.begin(Injection(number, fault, "ACK", 0, None, 0))
        run, bursts = desk.engine.run, []

        def counted(*arguments):
            bursts.append(arguments)
            assert len(bursts) < MOST_BURSTS
            return run(*arguments)

        desk.engine.run = counted
        ((us, seen),) = desk.run().log
        assert us <= TIMEOUT_US + 1
        return seen

    return wait


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])  # makes each one anew
@example([AckLate(delay_us=10), AckLost()])  # late, and never seen
@example([AckLate(delay_us=10), AckStuck(level=0)])
@given(FAULTS)
def test_wait_for_acknowledge_ends_under_any_pin_faults(waiting, faults):
    assert waiting(faults) is sees(faults)


class Engine:
    now_ps, running, driver = 5, 0, "driver"

    def __init__(self) -> None:
        self.order: list[str] = []

    def get_pin(self, name):
        self.order.append(name)
        return 1

    def strobe_read(self, out, period, until_ps):
        self.order.append("strobe")
        return 3

    def access(self, transactions, until_ps):
        self.order.append("access")
        return 4


def test_reports_lost_acknowledge_once():
    told = []

    def report(_time_ps, injection, text):
        injection.hits += 1  # as the injector counts
        told.append(text)

    pins = PinFaults(Kernel(), report, Engine())
    pins.begin(Injection(0, AckLost(), "ACK", 0, None, 0))
    assert [pins.get_pin("ACK") for _ in range(3)] == [0, 0, 0]
    assert told == ["begins with the pin at 1", "ACK rise not seen"]


def test_hooks_around_reads_run_before_and_after_each():
    """A memory's stuck bits hold whenever the processor takes bytes, and at no other time."""
    engine = Engine()
    pins = PinFaults(Kernel(), lambda _time_ps, _injection, _text: None, engine, "DATA")
    assert pins.driver == "driver"
    pins.around_reads += [lambda: engine.order.append("a"), lambda: engine.order.append("b")]
    assert pins.driver is None
    assert pins.get_pin("DATA") == 1
    assert engine.order[:3] == ["a", "b", "DATA"]
    del engine.order[:]
    pins.get_pin("ACK")
    assert set(engine.order) == {"ACK"}
    del engine.order[:]
    assert (pins.strobe_read(None, None, 9), pins.access(None, 9)) == (3, 4)
    assert engine.order == ["a", "b", "strobe", "a", "b", "a", "b", "access", "a", "b"]
