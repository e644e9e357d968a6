"""Both ways are run in turn, and the better one is faster."""

from types import SimpleNamespace

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.mcu.inner_loops import loops_in_use
from cubestack.host.studies import ratios


def test_ratio_is_of_the_best_of_both_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s, seen = 0.0, list[str]()
    takes = {"ours": iter([0.2, 0.5, 0.3]), "reference": iter([0.9, 0.6, 0.7])}

    def way(name: str) -> None:
        nonlocal now_s
        seen.append(name)
        now_s += next(takes[name])

    monkeypatch.setattr(ratios, "ROUNDS", 3)
    monkeypatch.setattr(ratios, "time", SimpleNamespace(process_time=lambda: now_s))
    assert ratios.ratio(lambda: way("ours"), lambda: way("reference")) == pytest.approx(3.0)
    assert seen == 3 * ["ours", "reference"]


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_every_declared_ratio_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ratios, "ROUNDS", 1)
    found = ratios.light_ratio() | ratios.device_ratios("cubestar")
    assert {name.replace("cubestar", "DEVICE") for name in found} == {*ratios.MEANINGS}
    assert found["light_ratio"] > 1
    assert found["cubestar_reuse_ratio"] > 1
    assert loops_in_use() is not None
