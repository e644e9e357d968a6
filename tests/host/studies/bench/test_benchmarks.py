"""Benchmarks on a fake clock."""

import json
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from amaranth.hdl import Fragment

from cubestack.emulator.rtl.wiring import Wiring
from cubestack.host.devices.registry import BUILT_IN, device
from cubestack.host.studies import bench
from cubestack.host.studies.aramis import benchmark as aramis
from cubestack.host.studies.bench import Benchmark
from cubestack.host.studies.cubesense import benchmark as cubesense
from cubestack.host.studies.cubestar import benchmark as cubestar
from tests.conftest import Run


class Clock:
    """Simulated wall time, which is the processor's too."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def perf_counter(self) -> float:
        return self.now_s

    process_time = perf_counter


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    for module in (bench, cubestar):
        monkeypatch.setattr(module, "time", made)
    return made


class Device:
    """An emulated device whose virtual time passes four times as fast as wall time.

    Attributes:
        said: commands, each with its virtual time.
    """

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.time_s = 50.0
        self.said = list[tuple[Any, float]]()
        self.client = self

    def pause(self, seconds: float) -> None:
        self.time_s += seconds
        self.clock.now_s += seconds / 4

    def command(self, name: str, **_values: object) -> None:
        self.said.append((name, self.time_s))

    def result_then_schedule(self, camera: object) -> None:
        self.said.append((camera, self.time_s))
        self.pause(0.125)


def powered(one: Device, asked: list[dict[str, Any]]) -> Callable[..., Any]:
    """Replaces ``power_up``."""

    def power_up(*_given: object, **options: Any) -> Any:
        asked.append(options)
        return nullcontext(one)

    return power_up


def built(wiring: Wiring, seconds: float) -> float:
    """Replaces `cold_build_s`; Amaranth warns of designs that are not elaborated."""
    Fragment.get(wiring.component, None)
    return seconds


def test_ratio_is_virtual_time_by_processor_time(clock: Clock) -> None:
    one: Any = Device(clock)
    assert bench.simulated_ratio(one, lambda: one.pause(3.0)) == 4.0

    def slower() -> None:
        one.pause(3.0)
        clock.now_s += 1.0

    assert bench.simulated_ratio(one, slower) == 1.71


def test_best_ms_is_the_shortest_of_5_runs(clock: Clock) -> None:
    times = iter([0.5, 0.0312345, 0.2, 0.04, 0.7, 0.0])

    def run() -> None:
        clock.now_s += next(times)

    assert bench.best_ms(run) == 31.2
    assert next(times) == 0.0  # five were measured


def test_both_sensors_are_read_once_per_second(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, asked = Device(clock), list[dict[str, Any]]()
    monkeypatch.setattr(cubesense, "power_up", powered(one, asked))
    assert cubesense._loop_ratio(device("cubesense")) == 4.0
    times = [time_s for _, time_s in one.said]
    assert len(times) == 2 * (bench.LOOP_S + 1)
    for first, second in zip(times[::2], times[2::2], strict=False):
        assert second - first == pytest.approx(1.0)
    assert len({camera for camera, _ in one.said}) == 2


def test_capture_and_transfer_are_timed_separately(clock: Clock) -> None:
    turns = iter([(0.5, 0.2), (0.25, 0.3), (0.4, 0.125), (0.9, 0.9), (0.9, 0.9)])

    class Engine:
        """Each strobe takes the wall time of its turn."""

        def strobe_read(self, out: bytearray, period: int, until_ps: int) -> int:
            clock.now_s += transfer_s / 2
            return len(out) + period + until_ps

    def capture() -> None:
        nonlocal transfer_s
        capture_s, transfer_s = next(turns)
        clock.now_s += capture_s
        assert [engine.strobe_read(bytearray(2), 3, 4) for _ in range(2)] == [9, 9]

    transfer_s, engine = 0.0, Engine()
    emulated: Any = SimpleNamespace(
        board=SimpleNamespace(engine=engine), client=SimpleNamespace(capture=capture)
    )
    figures = cubestar._capture(emulated)
    assert figures == {"capture_wall_ms": 250.0, "readout_wall_ms": 125.0}
    assert engine.strobe_read.__func__ is Engine.strobe_read  # type: ignore[attr-defined]


def test_i2c_rates_are_measured_on_each_working_route(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[list[str]]()

    def run(command: list[str], **_options: Any) -> SimpleNamespace:
        asked.append(command)
        works = "preload" not in command
        return SimpleNamespace(returncode=0 if works else 1, stdout="1234.6\n" if works else "")

    monkeypatch.setattr(cubestar.subprocess, "run", run)
    assert cubestar._i2c() == {"i2c_seccomp_fast": 1235, "i2c_seccomp_real": 1235}
    assert len(asked) == 4
    assert all(command[command.index("--hz") + 1] == "400000" for command in asked)


def test_i2c_client_prints_the_median_rate(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = 0.0

    def read_byte_data(address: int, register: int) -> int:
        nonlocal now_s
        assert (address, register) == (0x1A, 0x83)
        now_s += 0.001 if now_s < 1.45 else 0.5
        return 0

    bus = SimpleNamespace(read_byte_data=read_byte_data)
    monkeypatch.setitem(sys.modules, "smbus2", SimpleNamespace(SMBus=lambda number: bus))
    monkeypatch.setitem(sys.modules, "time", SimpleNamespace(perf_counter=lambda: now_s))
    exec(cubestar.I2C_CLIENT, {})
    assert float(capsys.readouterr().out) == pytest.approx(1000, rel=0.01)


def test_cubestar_benchmark_reports_all_its_figures(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, asked = Device(clock), list[dict[str, Any]]()
    monkeypatch.setattr(cubestar, "power_up", powered(one, asked))
    names = ("rtl_clocks_per_s", "strides_per_s", "strobes_per_s", "instructions_per_s")
    for name, rate in zip(names, (1000.4, 2000.6, 3000.2, 4000.7), strict=True):
        monkeypatch.setattr(cubestar, name, lambda rate=rate: rate)
    monkeypatch.setattr(cubestar, "unicorn_ratios", lambda: {"unicorn_ratio": 1.5})
    monkeypatch.setattr(cubestar, "cold_build_s", lambda wiring: built(wiring, 5.678))
    alone = "cubestack.host.studies.cubestar.identification.identification_figures"
    monkeypatch.setattr(alone, lambda: {"identify_10_ms": 0.3})
    monkeypatch.setattr(cubestar, "_capture", lambda _emulated: {"capture_wall_ms": 1.0})
    monkeypatch.setattr(cubestar, "_i2c", lambda: {"i2c_seccomp_fast": 7.0})
    assert cubestar.BENCHMARK.run(device("cubestar")) == {
        "rtl_clocks_per_s": 1000,
        "rtl_strides_clocks_per_s": 2001,
        "strobes_per_s": 3000,
        "capture_wall_ms": 1.0,
        "realtime_ratio": 4.0,
        "instructions_per_s": 4001,
        "unicorn_ratio": 1.5,
        "identify_10_ms": 0.3,
        "firmware_ratio": 4.0,
        "cold_build_s": 5.7,
        "i2c_seccomp_fast": 7.0,
    }
    assert [what for what, _ in one.said] == ["Trigger", "StopLoop", "Trigger"]
    begun_s, ended_s, again_s = (time_s for _, time_s in one.said)
    assert min(ended_s - begun_s, one.time_s - again_s) >= bench.LOOP_S + 0.9
    assert asked == [{"engine": "compiled"}, {"engine": "compiled", "firmware": "reference"}]


def test_cubesense_benchmark_reports_all_its_figures(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cubestack.emulator.boards.cubesense import benchmark as board

    monkeypatch.setattr(cubesense, "power_up", powered(Device(clock), []))
    monkeypatch.setattr(board, "pair_with_cameras", lambda: "pair")
    monkeypatch.setattr(board, "pair_store_ms", lambda _pair, way: len(way) + 0.06)
    monkeypatch.setattr(board, "pair_scan_ms", lambda _pair: 1.44)
    monkeypatch.setattr(cubesense, "cold_build_s", lambda wiring: built(wiring, 9.04))
    found = cubesense.BENCHMARK.run(device("cubesense"))
    stored = {f"pair_{way}_ms": len(way) + 0.1 for way in board.STORES}
    assert found == {**stored, "sensors_ratio": 4.0, "pair_scan_ms": 1.4, "pair_build_s": 9.0}
    assert set(found) == set(cubesense.BENCHMARK.figures)


def test_aramis_benchmark_reports_all_its_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes pictures in its loop, which needs activation."""
    monkeypatch.setattr(bench, "ROUNDS", 1)
    monkeypatch.setattr(aramis, "LOOP_S", 1)
    found = aramis.BENCHMARK.run(device("aramis"))
    assert set(found) == set(aramis.BENCHMARK.figures)
    assert min(found.values()) > 0


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Devices with fake benchmarks, and one without any."""

    def benchmark_of(name: str) -> Benchmark:
        return Benchmark({name: f"of {name}"}, lambda _one: {name: 1234.5})

    made = [
        replace(device(name), studies={"bench": lambda name=name: benchmark_of(name)})
        for name in BUILT_IN
    ]
    made[1] = replace(made[1], studies={})
    monkeypatch.setattr(bench, "devices", lambda: made)
    monkeypatch.setattr(bench, "light_ratio", lambda: {})
    monkeypatch.setattr(bench, "device_ratios", lambda name: {f"{name}_reuse_ratio": 2.5})


@pytest.mark.usefixtures("measured")
def test_command_measures_every_device_with_a_benchmark(run: Run) -> None:
    first, without, third = BUILT_IN
    found = run("bench", "--json")
    figures = dict.fromkeys((first, third), 1234.5)
    figures |= {f"{name}_reuse_ratio": 2.5 for name in (first, third)}
    assert (found.code, json.loads(found.out)) == (0, figures)
    lines = run("bench").out.splitlines()
    assert {tuple(line.split()) for line in lines} == {
        (name, f"{value:,}") for name, value in figures.items()
    }
    told = run("bench", "--help").out
    assert f"of {first}" in told
    assert f"of {without}" not in told
    assert "make bench-engines" in told
