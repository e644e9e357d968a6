from pathlib import Path

import pytest

from cubestack.host.emulation.controls import Controls, EmulatedControls
from cubestack.host.emulation.remote_controls import TOKEN as VARIABLE
from cubestack.host.emulation.remote_controls import ControlClient, RemoteControls
from cubestack.host.emulation.remote_controls import controlled as controlled_at
from cubestack.host.errors import PortOpenError, TargetError

from .conftest import TOKEN, Controlled


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
    assert controlled.ask("GET", "/state")[1]["held"]
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


def test_advance_keeps_time_running(controlled: Controlled, remote: RemoteControls) -> None:
    remote.advance(100.0)
    assert not controlled.ask("GET", "/state")[1]["held"]


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
