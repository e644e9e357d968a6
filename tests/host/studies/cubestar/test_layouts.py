from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.host.studies.cubestar import layouts
from cubestack.host.studies.cubestar.layouts import Found, LayoutOptions, LayoutResult

VOLTS = 3.3


def measured(monkeypatch: pytest.MonkeyPatch, found: list[Found]) -> LayoutResult:
    """The result of a loop that gave ``found``."""
    table = SimpleNamespace(volts=VOLTS)
    emulated: Any = SimpleNamespace(
        board=SimpleNamespace(
            engine=SimpleNamespace(violation_counts={}), power=SimpleNamespace(table=table)
        ),
        client=SimpleNamespace(
            client=SimpleNamespace(command=lambda _name: None), phase_times=dict[str, float]
        ),
    )
    monkeypatch.setattr(layouts, "attitudes_of_loop", lambda _board, _seconds: iter(found))
    options = LayoutOptions(seconds=2)
    return layouts._measure(Layout.COPIED, lambda *_, **__: nullcontext(emulated), options)


def test_age_grows_until_the_next_attitude(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two attitudes per second with an age of 300 ms, at 100 mA."""
    turns = [Found(n * 10**12 // 2, 50.0 * n, 300.0, right=True) for n in range(5)]
    result = measured(monkeypatch, turns)
    assert (result.attitudes, result.right, result.rate_hz) == (4, 4, 2.0)
    assert (result.age_ms, result.oldest_ms) == (300.0, 800.0)
    assert (result.power_mw, result.energy_mj) == (pytest.approx(330), pytest.approx(165))


def test_one_attitude_has_no_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    result = measured(monkeypatch, [Found(10**12, 5.0, 300.0, right=None)])
    assert (result.attitudes, result.right, result.rate_hz) == (0, None, None)
    assert result.age_ms is result.oldest_ms is result.power_mw is result.energy_mj is None
