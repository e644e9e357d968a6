from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.iss.insight.reports import MemoryUse
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.attitude import matrix_from_quaternion, pointing_from_matrix
from cubestack.firmware_model.interface.cubestar import MatchMode, TaskStatus
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.host.experiments.cubestar import measure
from cubestack.host.studies.cubestar import layouts, memory
from cubestack.host.studies.cubestar import night as module
from cubestack.host.studies.cubestar.layouts import Found, LayoutOptions, LayoutResult
from cubestack.host.studies.cubestar.night import INTERVAL_S, SETTLING, night
from cubestack.host.studies.cubestar.shots import _shot
from cubestack.host.studies.fidelity.table import Job, perform

#: Of each field: sigma of right ascension, declination and roll, deg; part that is valid.
CALM, SHAKEN, BLIND = (0.01, 0.02, 0.05, 1.0), (0.01, 2.0, 0.05, 1.0), (0.01, 0.01, 0.01, 0.4)
OFF_DEG = {6: 40.0}
"""A field where the node is calm and wrong."""
GOOD = {0: CALM, 2: (0.03, 0.01, 0.1, 0.5), 5: (0.02, 0.04, 0.02, 0.9)}
WRONG = {6: CALM}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The scenes, and the requests for lines of a log."""
    seen = list[Any]()

    def log_lines(_client: object, _clock: object, *, count: int, interval_s: float) -> Any:
        field = sum(isinstance(one, SimpleNamespace) for one in seen)
        seen.append(SimpleNamespace(count=count, interval_s=interval_s))
        sigmas = (GOOD | WRONG).get(field, SHAKEN if field % 2 else BLIND)
        valid = round(sigmas[3] * (count - SETTLING))
        for number in range(count):
            sign = (-1) ** number
            off = [sign * each for each in sigmas[:3]] if number >= SETTLING else [50.0] * 3
            yield {
                "time_s": float(number),
                "valid": number < SETTLING + valid,
                "matched": 8 + number % 5 + field,
                "ra_deg": off[0],
                "dec_deg": off[1] + module.LATITUDE_DEG + OFF_DEG.get(field, 0.0),
                "roll_deg": off[2],
            }

    monkeypatch.setattr(module, "log_lines", log_lines)
    monkeypatch.setattr(module, "choose_threshold", lambda _client: 25)
    return seen


def opener(seen: list[Any]) -> Any:
    @contextmanager
    def opened(view: Any, *, seed: int) -> Iterator[Any]:
        seen.append(view.scene)
        commands = SimpleNamespace(command=lambda name: seen.append(name))
        yield SimpleNamespace(client=SimpleNamespace(client=commands), time_s=0.0)

    return opened


def test_scatter_is_pooled_over_calm_visible_fields(asked: list[Any]) -> None:
    found = night(opener(asked), 400)
    assert found["fields"] == len(GOOD)
    for place, name in enumerate(("ra", "dec", "roll")):
        pooled = np.sqrt(np.mean([sigmas[place] ** 2 for sigmas in GOOD.values()]))
        assert found[name] == pytest.approx(pooled, rel=0.03)
    # Along a parallel, a degree of right ascension is shorter than on the equator.
    across = [np.hypot(one[0] * np.cos(np.radians(33.93)), one[1]) for one in GOOD.values()]
    assert found["across"] == pytest.approx(np.sqrt(np.mean(np.square(across))), rel=0.03)
    assert found["valid"] == pytest.approx(100 * np.mean([one[3] for one in GOOD.values()]))
    assert found["fewest"] == pytest.approx(np.mean([8 + field for field in GOOD]))
    assert found["most"] == pytest.approx(np.mean([12 + field for field in GOOD]))


def test_night_fields_are_at_the_zenith_over_a_sidereal_day(asked: list[Any]) -> None:
    night(opener(asked), 10)
    scenes = [one for one in asked if hasattr(one, "quaternion")]
    asked_for = [one for one in asked if isinstance(one, SimpleNamespace)]
    assert len(scenes) == len(asked_for) == 8
    assert {(one.count, one.interval_s) for one in asked_for} == {(10 + SETTLING, INTERVAL_S)}
    assert asked.count("Trigger") == 8
    for number, scene in enumerate(scenes):
        ra, dec, _ = pointing_from_matrix(matrix_from_quaternion(scene.quaternion))
        assert (ra % 360, dec) == pytest.approx((45.0 * number, -33.93), abs=1e-6)
        # The Earth turns by 15 deg an hour, and takes the camera with it.
        assert np.linalg.norm(scene.rate_deg_s) == pytest.approx(360 / 86164.1, rel=1e-4)
        assert scene.atmosphere.sky_mag == 20.0


@pytest.mark.parametrize("frames", [1, 3])
def test_quick_run_measures_one_field(asked: list[Any], frames: int) -> None:
    night(opener(asked), frames)
    asked_for = [one for one in asked if isinstance(one, SimpleNamespace)]
    assert [(one.count, one.interval_s) for one in asked_for] == [(3 + SETTLING, 1.0)]


def test_attitude_without_matched_stars_counts_0(
    asked: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = module.log_lines

    def unnamed(*of: Any, **how: Any) -> Iterator[Any]:
        for number, line in enumerate(lines(*of, **how)):
            yield line | {"matched": None if number == SETTLING else line["matched"]}

    monkeypatch.setattr(module, "log_lines", unnamed)
    assert night(opener(asked), 1)["fewest"] == 0


def test_no_usable_field_gives_no_figures(
    asked: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "QUICK_FIELD", 1)
    for spoilt in (SHAKEN, (0.01, 0.01, 1.2, 1.0), (0.01, 0.01, 0.01, 0.34)):
        monkeypatch.setitem(GOOD, 0, spoilt)
        asked.clear()
        assert night(opener(asked), 1) == {}


@pytest.mark.skipif(find_compiler() is None, reason="needs the compiled FPGA")
def test_simulated_night_meets_its_limits() -> None:
    found = perform(Job("cubestar", "night", "extended", 1, 1.0))
    assert (found["valid"], found["fields"]) == (100, 1)
    assert 8 <= found["fewest"] <= found["most"] <= 16
    for name in ("ra", "dec", "roll", "across"):
        assert 0 < found[name] < 0.02


TELEMETRY = {"DetectionSummary": {"NumStarsDetected": 9}, "NumIdStars": {"numIdStars": 4}}


@pytest.mark.parametrize(
    ("judged", "valid", "status", "stars"),
    [
        (False, True, TaskStatus.CALCULATED, (7, 0)),
        (False, False, TaskStatus.CALCULATION_FAILED, (0, 0)),
        (True, True, TaskStatus.CALCULATED, (4, 2)),
        (True, False, TaskStatus.CALCULATION_FAILED, (4, 2)),
        (True, False, TaskStatus.IDENTIFICATION_FAILED, (0, 0)),
    ],
)
def test_study_judges_identities_only_if_stars_are_identified(
    monkeypatch: pytest.MonkeyPatch,
    judged: bool,
    valid: bool,
    status: TaskStatus,
    stars: tuple[int, int],
) -> None:
    truth = np.array([0.0, 0.0, 0.0, 1.0])
    attitude = SimpleNamespace(
        valid=valid, quaternion=truth, matched=7, mode=MatchMode.LOST_IN_SPACE
    )
    cubestar = SimpleNamespace(
        capture_and_process=lambda: status,
        attitude=lambda: attitude,
        client=SimpleNamespace(telemetry=TELEMETRY.__getitem__),
    )
    device: Any = SimpleNamespace(client=cubestar, board=SimpleNamespace(truth=lambda: truth))
    monkeypatch.setattr(measure, "count_wrong", lambda *_: 2)
    shot = _shot(device, judged=judged)
    assert (shot.valid, shot.right, shot.detected) == (valid, valid, 9)
    assert (shot.matched, shot.wrong) == stars


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
    return layouts.measure_layout(Layout.COPIED, lambda *_, **__: nullcontext(emulated), options)


def test_age_grows_until_the_next_attitude(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two attitudes per second with an age of 300 ms, at 100 mA."""
    turns = [Found(n * 10**12 // 2, 50.0 * n, 300.0, right=True) for n in range(5)]
    result = measured(monkeypatch, turns)
    assert (result.attitudes, result.right, result.rate_hz) == (4, 4, 2.0)
    assert (result.age_ms, result.oldest_ms) == (300.0, 800.0)
    assert (result.power_mw, result.energy_mj) == (pytest.approx(330), pytest.approx(165))


def test_single_attitude_yields_no_rate_or_age(monkeypatch: pytest.MonkeyPatch) -> None:
    result = measured(monkeypatch, [Found(10**12, 5.0, 300.0, right=None)])
    assert (result.attitudes, result.right, result.rate_hz) == (0, None, None)
    assert result.age_ms is result.oldest_ms is result.power_mw is result.energy_mj is None


USE = MemoryUse(
    **{"flash": 262_144, "flash_size": 1 << 20, "ram_size": 1 << 17, "static": 1 << 15},
    **{"heap": 1 << 10, "stack": None, "process_stack": 0x2000_1F00, "free": 96},
)


@pytest.mark.parametrize("capture", [False, True])
def test_memory_is_reported_after_a_run(monkeypatch: pytest.MonkeyPatch, capture: bool) -> None:
    done = list[object]()
    client = SimpleNamespace(capture_and_process=lambda: done.append("capture"))

    @contextmanager
    def opened(_scene: object, *, seed: int) -> Iterator[Any]:
        yield SimpleNamespace(client=client, wait=done.append)
        done.append("closed")

    monkeypatch.setattr(memory, "own_firmware", lambda *_words: SimpleNamespace(observer=None))
    monkeypatch.setattr(memory, "memory_use", lambda _observer: USE)
    options = memory.MemoryOptions(seconds=1.5, capture=capture)
    (facts,) = memory.EXPERIMENT.run(opened, options)
    assert done == [1.5, *["capture"] * capture, "closed"]
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
