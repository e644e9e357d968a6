import pytest

from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.sim.virtual_time import Kernel


class Desk:
    def __init__(self, mode: str = "real", ns: int = 1_000_000_007) -> None:
        self.ns, self.kernel = ns, Kernel()
        self.pace = Pace(self.kernel, mode, lambda: self.ns)  # type: ignore[arg-type]


def test_the_scale_begins_where_virtual_time_is() -> None:
    desk = Desk()
    assert (desk.pace.now_ps(), desk.pace.now_ns()) == (0, desk.ns)
    desk.ns += 5
    assert desk.pace.now_ps() == 5000
    desk.kernel.run(until=7_000_000)
    desk.pace.align()
    assert desk.pace.now_ps() == 7_000_000
    desk.ns += 3
    assert desk.pace.now_ps() == 7_003_000


@pytest.mark.parametrize("speed", [1.0, 2.0, 0.25, 3.7])
def test_a_speed_holds_from_its_change_on(speed: float) -> None:
    desk = Desk()
    desk.ns += 1000
    desk.kernel.run(until=desk.pace.now_ps())
    desk.pace.change("real", speed)
    assert desk.pace.now_ps() == pytest.approx(1_000_000, abs=1)
    desk.ns += 2000
    assert desk.pace.now_ps() == pytest.approx(1_000_000 + 2_000_000 * speed, abs=2)


@pytest.mark.parametrize("speed", [1.0, 2.0, 0.5, 3.7])
def test_conversions_agree_and_never_round_early(speed: float) -> None:
    desk = Desk()
    desk.kernel.run(until=12_345)
    desk.pace.change("real", speed)
    for ps in (12_345, 12_346, 13_345, 13_344, 999_999, 10**9 + 1):
        ns = desk.pace.ns_at(ps)
        assert desk.pace.ps_at(ns) >= ps - 1
        assert desk.pace.ps_at(ns - 1) < ps
    if speed == 1.0:
        at = desk.pace.now_ns()
        assert [desk.pace.ns_at(12_345 + ps) - at for ps in (0, 1, 1000, 1001)] == [0, 1, 1, 2]


def test_the_mode_says_who_waits() -> None:
    desk = Desk("fast")
    assert desk.pace.fast
    desk.pace.change("real")
    assert not desk.pace.fast
    assert desk.pace.speed == 1.0
