import sys
import threading
from io import BytesIO

import pytest

from cubestack.host.errors import TargetError
from cubestack.host.ground.traces import Bench
from tests.emulator.recording import vcd

from .conftest import SOON_S, Controlled

TRACE = "/devices/cubestar/trace"


def changes(text: str) -> vcd.Changes:
    return vcd.read(BytesIO(text.encode()))


def test_trace_of_a_past_time_span(controlled: Controlled) -> None:
    controlled.run(1.0)
    controlled.act("fault", "processor-reset")
    controlled.run(3.0)
    status, text = controlled.ask("GET", f"{TRACE}?from_s=0.9&to_s=2.5", as_text=True)
    assert (status, text.splitlines()[0]) == (200, "$timescale 1 ns $end")
    found = changes(text)
    assert any(name.startswith("fpga.") for name in found)
    times = [time for all_of in found.values() for time, _ in all_of[1:]]
    assert min(times) >= 0.9e9
    assert max(times) <= 2.5e9
    assert controlled.state()["time_s"] == 3.0
    awake = found["firmware.awake"]
    assert len(awake) > 2  # it was reset in this span, and slept before and after
    before = controlled.ask("GET", f"{TRACE}?from_s=0.5&to_s=0.99", as_text=True)[1]
    assert len(changes(before)["firmware.awake"]) < len(awake)


def test_rejects_invalid_time_spans(controlled: Controlled) -> None:
    controlled.run(60.6)
    for span, error in (
        ("from_s=0.5", "needs 'to_s'"),
        ("from_s=0&to_s=much", "could not convert"),
        ("from_s=nan&to_s=0.5", "current time"),
        ("from_s=0.4&to_s=0.4", "current time"),
        ("from_s=0&to_s=99", "current time"),
        ("from_s=0&to_s=60.5", "at most 60 s"),
    ):
        status, told = controlled.ask("GET", f"{TRACE}?{span}")
        assert status == 400
        assert error in told["error"]
    assert controlled.emulation.trace("cubestar", 0.5, 60.5).to_s == 60.5


def test_only_one_trace_at_a_time(controlled: Controlled) -> None:
    controlled.run(0.6)
    with controlled.emulation.bench._free:
        status, told = controlled.ask("GET", f"{TRACE}?from_s=0&to_s=0.5")
    assert (status, told["error"]) == (409, "another waveform is being computed")


def test_running_trace_ends_with_the_emulation() -> None:
    bench, said = Bench(), list[str]()
    for_ever = [sys.executable, "-c", "import threading; threading.Event().wait()"]
    making = threading.Thread(target=lambda: said.append(failed(bench, for_ever)))
    making.start()
    while bench._process is None:
        assert making.is_alive()
    bench.close()
    making.join(SOON_S)
    assert said == ["no waveform: -9"]
    assert failed(bench, for_ever) == "no waveform: the emulation is ending"


def failed(bench: Bench, call: list[str]) -> str:
    with pytest.raises(TargetError) as refusal:
        bench.run(call)
    return str(refusal.value)
