import json
import sys
import threading
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest

from cubestack.host.emulation.controls import Controls, EmulatedControls
from cubestack.host.emulation.remote_controls import TOKEN as VARIABLE
from cubestack.host.emulation.remote_controls import ControlClient, RemoteControls
from cubestack.host.emulation.remote_controls import controlled as controlled_at
from cubestack.host.errors import PortOpenError, TargetError
from cubestack.host.ground.control_api import CALLS
from cubestack.host.ground.traces import Bench
from tests.emulator.recording import vcd

from .conftest import SOON_S, TOKEN, Controlled, listening


def test_control_api_root_lists_all_calls(controlled: Controlled) -> None:
    status, told = controlled.ask("GET", "/")
    assert status == 200
    assert [call["path"] for call in told["calls"]] == [call.path for call in CALLS]
    assert told["devices"] == ["cubestar"]


def test_document_describes_every_call() -> None:
    page = (Path(__file__).parents[3] / "docs" / "reference" / "control-api.md").read_text("utf-8")
    for call in CALLS:
        assert f"`{call.method} {call.path.replace('{device}', 'NAME')}`" in page
        assert all(f"`{name}`" in page for name in call.takes)


def test_pause_step_run_and_resume(controlled: Controlled) -> None:
    controlled.run(20.0)  # it has booted
    _, held = controlled.ask("POST", "/pause")
    assert held["held"]
    assert controlled.state()["time_s"] == held["time_s"] == 20.0
    assert controlled.ask("POST", "/step") == (200, {"events": 0})  # it waits for its host
    controlled.act("fault", "processor-reset")
    assert controlled.ask("POST", "/step", {"events": 3}) == (200, {"events": 3})
    status, there = controlled.run(500)
    assert (status, there["time_s"], there["held"]) == (200, 500.0, True)
    _, resumed = controlled.ask("POST", "/resume")
    assert not resumed["held"]
    _, paced = controlled.ask("POST", "/pace", {"pace": "real", "speed": 4})
    assert (paced["pace"], paced["speed"]) == ("real", 4)


def test_act_executes_shell_commands(controlled: Controlled) -> None:
    before = controlled.state()["devices"]["cubestar"]["currents_ma"]["total"]
    _, state = controlled.act("power", "imager", "off")
    assert state["devices"]["cubestar"]["currents_ma"]["total"] < before
    about = controlled.ask("GET", "/devices/cubestar")[1]
    assert "imager" in about["channels"]
    kind = "processor-reset"
    assert kind in about["faults"]
    assert controlled.act("fault", kind)[0] == 200
    controlled.run(100)
    log = controlled.ask("GET", "/devices/cubestar/log")[1]
    assert log["count"] == len(log["log"]) > 0
    assert kind in log["log"][0]
    assert controlled.state()["devices"]["cubestar"]["probes"]["resets"] == 1


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "error"),
    [
        ("GET", "/stat", None, 404, "known: /back"),
        ("DELETE", "/state", None, 405, "Method Not Allowed"),
        ("POST", "/step", b"{", 400, "the body is not valid JSON"),
        ("POST", "/step", b"\xff\xfe", 400, "the body is not UTF-8 text"),
        ("POST", "/step", b"[" * 100_000, 400, "the body: lists and tables are nested"),
        ("POST", "/step", [], 400, "the body must be a JSON object with events"),
        ("POST", "/step", {"evnts": 1}, 400, "/step has no member 'evnts'; known: events"),
        ("POST", "/step", {"events": "1"}, 400, "'events' of /step must be an integer, not '1'"),
        ("POST", "/step", {"events": True}, 400, "'events' of /step must be an integer, not True"),
        ("POST", "/step", {"events": 0}, 400, "a step is 1 to 100000 events, not 0"),
        ("POST", "/run", {}, 400, "/run needs 'to_s'"),
        ("POST", "/run", {"to_s": -1}, 400, "to_s must be 0 to 1e+08 s, not -1"),
        ("POST", "/run", b'{"to_s": NaN}', 400, "NaN is not a number of JSON"),
        ("POST", "/back", b'{"to": NaN}', 400, "NaN is not a number of JSON"),
        ("POST", "/back", {"to": True}, 400, "'to' of /back must be a number or a text, not True"),
        ("POST", "/pace", {"pace": "slow"}, 400, "pace must be real or fast, not 'slow'"),
        ("GET", "/devices/cubestat", None, 400, "no device 'cubestat' is emulated here"),
        ("POST", "/devices/cubestar/act", {"words": [1]}, 400, "'words' must be texts"),
        ("POST", "/devices/cubestar/act", {"words": ["dance"]}, 400, "nothing does 'dance'"),
        ("POST", "/devices/cubestar/act", {"words": ["fault", "flod"]}, 400, "flod"),
        (
            *("POST", "/devices/cubestar/act"),
            *({"words": ["scene", "sky.toml"], "text": "[pointin]\n"}, 400, "sky.toml: "),
        ),
    ],
)
def test_rejects_invalid_requests(
    controlled: Controlled, method: str, path: str, body: Any, status: int, error: str
) -> None:
    found, told = controlled.ask(method, path, body)
    assert (found, list(told)) == (status, ["error"])
    assert error in told["error"]
    assert controlled.ask("GET", "/state")[0] == 200


def test_events_report_state_and_log(controlled: Controlled) -> None:
    with listening(controlled.serving, "/events?every_s=0.05") as socket:
        first = json.loads(socket.recv(SOON_S))
        controlled.act("fault", "processor-reset")
        controlled.run(50)
        while "log" not in (message := json.loads(socket.recv(SOON_S))):
            pass
        assert "processor-reset" in message["log"]["cubestar"][0]
        assert message["state"]["time_s"] >= first["state"]["time_s"]
        controlled.ask("POST", "/pause")
        socket.send("whatever it is")
        while not json.loads(socket.recv(SOON_S))["state"]["held"]:
            pass


def test_emulation_continues_after_clients_disconnect(controlled: Controlled) -> None:
    for _ in range(5):
        listening(controlled.serving, "/events").socket.close()
    assert controlled.ask("GET", "/state")[0] == 200


def test_back_returns_to_a_time_or_snapshot(controlled: Controlled) -> None:
    controlled.run(20)
    at_rest = controlled.state()["devices"]
    assert controlled.ask("POST", "/snapshot", {"name": "rest"})[1]["snapshots"] == {"rest": 20.0}
    controlled.run(30)
    controlled.act("power", "imager", "off")
    controlled.act("fault", "processor-reset")
    controlled.run(40)
    _, late = controlled.ask("POST", "/snapshot", {"name": "late"})
    assert late["devices"] != at_rest
    status, there = controlled.ask("POST", "/back", {"to": "rest"})
    assert (status, there["time_s"], there["held"], there["goes_back"]) == (200, 20.0, True, False)
    assert there["devices"] == at_rest
    assert list(there["snapshots"]) == ["rest"]
    status, told = controlled.ask("POST", "/back", {"to": "late"})
    assert (status, told["error"]) == (400, "no snapshot 'late'; known: rest")
    for never in (20.5, -1, 1e300):
        assert controlled.ask("POST", "/back", {"to": never})[0] == 400
    assert controlled.ask("POST", "/back", {"to": 0})[1]["time_s"] == 0


def test_recording_is_complete_at_any_time(controlled: Controlled) -> None:
    controlled.run(20)
    controlled.act("power", "imager", "off")
    status, text = controlled.ask("GET", "/devices/cubestar/recording", as_text=True)
    lines = [json.loads(line) for line in text.splitlines()]
    assert (status, lines[0]["device"]) == (200, "cubestar")
    assert lines[-1]["control"] == ["power", "imager", "off"]
    assert lines[-1]["ps"] == 20 * 10**12


def test_back_needs_a_recording(controlled: Controlled) -> None:
    controlled.emulation.past = "--gdb goes forward only"
    for method, path, body in (
        ("POST", "/back", {"to": 0}),
        ("POST", "/snapshot", {"name": "a"}),
        ("GET", "/devices/cubestar/recording", None),
    ):
        status, told = controlled.ask(method, path, body)
        assert (status, told["error"]) == (400, "no way back: --gdb goes forward only")
    assert controlled.ask("GET", "/devices/cubestar")[1]["no_past"] == "--gdb goes forward only"


# --- a client of the control port -----------------------------------------------------------------


@pytest.fixture
def remote(controlled: Controlled) -> RemoteControls:
    return RemoteControls(ControlClient(controlled.serving.url, TOKEN), "cubestar")


def test_remote_controls_match_local_controls(
    controlled: Controlled, remote: RemoteControls
) -> None:
    own: Controls = EmulatedControls(controlled.emulated)
    assert (remote.channels, remote.faults) == (own.channels, own.faults)
    assert remote.fault_parameters == own.fault_parameters
    controlled.ask("POST", "/pause")
    assert remote.currents() == own.currents()
    assert remote.time_s() == pytest.approx(own.time_s())


def test_remote_controls_act_on_the_device(
    controlled: Controlled, remote: RemoteControls, tmp_path: Path
) -> None:
    controlled.ask("POST", "/pause")
    before_s = remote.time_s()
    remote.fault(["processor-reset"])
    remote.advance(2.5)
    assert remote.time_s() == pytest.approx(before_s + 2.5)
    assert "processor-reset" in remote.fault_log()[0]
    assert controlled.state()["held"]
    remote.switch("imager", False)
    assert remote.currents()["imager"] == 0.0
    scene = tmp_path / "sky.toml"
    scene.write_text('kind = "sky"\nra_deg = 1.0\ndec_deg = 2.0\nroll_deg = 3.0\n', "utf-8")
    seen = controlled.emulated.scene
    remote.scene(scene)
    assert controlled.emulated.scene is not seen
    with pytest.raises(TargetError, match="no channel"):
        remote.switch("nobody", True)
    with pytest.raises(ValueError, match="only where the device is emulated in this process"):
        remote.peek("CMU")


def test_remote_advance_does_not_hold_time(controlled: Controlled, remote: RemoteControls) -> None:
    remote.advance(100.0)
    assert not controlled.state()["held"]


def test_token_is_read_from_the_environment(
    controlled: Controlled, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, TOKEN)
    assert controlled_at(controlled.serving.url).device == "cubestar"
    monkeypatch.setenv(VARIABLE, "another")
    with pytest.raises(PortOpenError, match=f"requires its token in .{VARIABLE}"):
        controlled_at(controlled.serving.url)


def test_rejects_invalid_and_unreachable_urls(controlled: Controlled) -> None:
    for url in ("nonsense", "http://127.0.0.1", "http://127.0.0.1:99999", ""):
        with pytest.raises(TargetError, match="is not the address of a control port"):
            ControlClient(url, "")
    host, port = controlled.serving.address
    with pytest.raises(PortOpenError, match="no control port answers"):
        ControlClient(f"http://{host}:{port ^ 1}", TOKEN).ask("GET", "/")


# --- waveforms of the past ------------------------------------------------------------------------

TRACE = "/devices/cubestar/trace"


def changes(text: str) -> vcd.Changes:
    return vcd.read(BytesIO(text.encode()))


@pytest.mark.slow
def test_control_api_traces_a_past_time_span(controlled: Controlled) -> None:
    controlled.run(1.0)
    controlled.act("fault", "processor-reset")
    controlled.run(1.6)
    status, text = controlled.ask("GET", f"{TRACE}?from_s=0.9&to_s=1.5", as_text=True)
    assert (status, text.splitlines()[0]) == (200, "$timescale 1 ns $end")
    found = changes(text)
    assert any(name.startswith("fpga.") for name in found)
    times = [time for all_of in found.values() for time, _ in all_of[1:]]
    assert min(times) >= 0.9e9
    assert max(times) <= 1.5e9
    assert controlled.state()["time_s"] == 1.6
    awake = found["firmware.awake"]
    assert len(awake) > 2  # it was reset in this span, and slept before and after
    before = controlled.ask("GET", f"{TRACE}?from_s=0.8&to_s=0.99", as_text=True)[1]
    assert len(changes(before)["firmware.awake"]) < len(awake)


def test_rejects_invalid_time_spans(controlled: Controlled) -> None:
    controlled.run(60.6)
    for span, error in (
        ("from_s=0.5", "needs 'to_s'"),
        ("from_s=0&to_s=much", "could not convert"),
        ("from_s=nan&to_s=0.5", "must be a finite number"),
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
