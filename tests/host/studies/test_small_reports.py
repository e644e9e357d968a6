"""Memory, settings before a measurement and the ball: what they say and send."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.iss.insight.reports import MemoryUse
from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.experiments.aramis import measure as aramis
from cubestack.host.studies.cubestar import memory
from cubestack.host.studies.fidelity.table import Job, perform

USE = MemoryUse(
    **{"flash": 262_144, "flash_size": 1 << 20, "ram_size": 1 << 17, "static": 1 << 15},
    **{"heap": 1 << 10, "stack": None, "process_stack": 0x2000_1F00, "free": 96},
)


class Observed:
    """A device with custom firmware that logs its calls."""

    def __init__(self) -> None:
        self.done = list[object]()
        self.client = SimpleNamespace(capture_and_process=lambda: self.done.append("capture"))

    def __enter__(self) -> "Observed":
        return self

    def __exit__(self, *_: object) -> None:
        self.done.append("closed")

    def wait(self, seconds: float) -> None:
        self.done.append(seconds)


@pytest.mark.parametrize("capture", [False, True])
def test_memory_is_reported_after_a_run(monkeypatch: pytest.MonkeyPatch, capture: bool) -> None:
    one = Observed()
    monkeypatch.setattr(memory, "own_firmware", lambda *_words: SimpleNamespace(observer=None))
    monkeypatch.setattr(memory, "memory_use", lambda _observer: USE)
    options = memory.MemoryOptions(seconds=1.5, capture=capture)
    opened: Any = lambda _scene, *, seed: one  # noqa: E731
    (facts,) = memory.EXPERIMENT.run(opened, options)
    assert one.done == [1.5, *["capture"] * capture, "closed"]
    assert facts.as_dict()["heap"] == 1024
    lines = list(memory._lines(USE))
    assert [line.split() for line in lines] == [
        ["flash", "262144", "bytes,", "25.0", "%"],
        ["static", "RAM", "32768", "bytes,", "25.0", "%"],
        ["heap", "1024", "bytes,", "0.8", "%"],
        ["stack", "not", "known:", "the", "program", "has", "no", "symbols", "for", "it"],
        ["process", "stack", "down", "to", "20001f00"],
        ["never", "touched", "96", "bytes,", "0.1", "%"],
    ]
    assert len({line.index(" bytes") for line in lines if " bytes" in line}) == 1  # aligned
    assert len(list(memory._lines(replace(USE, process_stack=None)))) == 5


# --- AraMiS ---------------------------------------------------------------------------------------


def sent(**options: Any) -> list[tuple[str, dict[str, Any]]]:
    said = list[tuple[str, dict[str, Any]]]()
    client = SimpleNamespace(
        command=lambda name, **values: said.append((name, values)),
        wait_processed=lambda timeout_s: said.append(("wait", {"s": timeout_s})),
    )
    star_tracker: Any = SimpleNamespace(client=client)
    aramis._configure(star_tracker, aramis.AramisOptions(**options))
    return said


def test_only_changed_settings_are_sent() -> None:
    (field, values), wait = sent()
    assert (field, values["FieldOfView"]) == ("SetField", pytest.approx(21.534639))
    assert wait[0] == "wait"
    assert [name for name, _ in sent(exposure=100, gain=3.5)] == [
        *("SetField", "SetExposure", "SetGain", "wait")
    ]
    assert sent(gain=3.5)[1] == ("SetGain", {"Gain": 3.5})


@pytest.mark.parametrize("exposure_ms", [0.001, 1.0, 20.0, 200.0])
def test_exposure_is_rounded_to_rows(exposure_ms: float) -> None:
    rows = sent(exposure=exposure_ms)[1][1]["Rows"]
    row_ms = 1000 * (1280 + 244) / 48e6
    assert abs(rows * aramis.ROW_S * 1000 - exposure_ms) <= max(aramis.ROW_S * 500, row_ms) * 1.001
    assert rows >= 1


FALSE_MAGS = aramis.AramisOptions.declared()["false_mags"]


@pytest.mark.parametrize("given", ["4.5,6", (4.5, 6), ("4.5", "6")])
def test_magnitudes_accept_text_and_pairs(given: object) -> None:
    assert FALSE_MAGS.take(given) == (4.5, 6.0)


@pytest.mark.parametrize("given", ["6,4.5", "4.5", "a,b", (6, 4.5)])
def test_magnitudes_reject_other_orders(given: object) -> None:
    with pytest.raises(ValueError, match=r"must (be|have) "):
        FALSE_MAGS.take(given)
    assert FALSE_MAGS.take("5,5") == (5.0, 5.0)


# --- the ball -------------------------------------------------------------------------------------


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_ball_is_seen_where_the_stage_moved_it() -> None:
    found = perform(Job("cubesense", "ball", "published", 1, 1.0))
    for direction in ("right", "left", "down", "up"):
        assert 0 < found[direction] < 0.5
    assert 0 <= found["sigma"] < 0.3
    assert np.isfinite(list(found.values())).all()
