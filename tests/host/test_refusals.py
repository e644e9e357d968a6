import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import smbus2
from PIL import Image

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host import targets
from cubestack.host.clients.contract import DeviceClient
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device
from cubestack.host.emulation.orbit import _seen
from cubestack.host.errors import BadAnswerError, PortOpenError, TargetError
from cubestack.host.experiments.measure import experiment_of, measure
from cubestack.host.pictures.figures import figure, save_curves
from cubestack.host.recording.setups import read_document
from cubestack.host.shell.language import Shell
from cubestack.host.shell.names import ShellError
from cubestack.host.studies import workers
from cubestack.host.studies.campaign.plan import CampaignPlan
from cubestack.host.studies.fidelity import table as fidelity
from cubestack.host.studies.fidelity.table import fidelity_of
from cubestack.host.studies.hazards import command as hazards
from cubestack.host.studies.upsets import experiment as upsets
from cubestack.host.studies.upsets.clean import Interval
from cubestack.host.targets import Target, connect, open_target
from tests.conftest import Run

from .conftest import FakeCubeStar, UartLink, over_i2c

compiled = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

# --- the command line -----------------------------------------------------------------------------


def test_picture_command_rejects_a_scene_without_sky(run: Run, tmp_path: Path) -> None:
    Image.fromarray(np.zeros((512, 1024), np.uint8)).save(tmp_path / "p.png")
    (tmp_path / "s.toml").write_text('kind = "picture"\nfile = "p.png"\n', "utf-8")
    words = ["picture", "cubestar", "--scene", tmp_path / "s.toml", "--out", tmp_path / "x.png"]
    found = run(*words)
    assert (found.code, found.line.endswith("s.toml is no sky")) == (2, True)


@compiled
def test_picture_command_names_an_unwritable_file(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "no" / "x.png"
    found = run("picture", "cubestar", "--ra", "84", "--dec", "-1", "--out", out)
    assert found.code == 2
    assert f"can not write {out}: No such file" in found.err


# --- targets and clients --------------------------------------------------------------------------


def test_control_is_rejected_for_an_emulation_in_this_process() -> None:
    for text in ("emulated:cubestar", "recorded:a.rec"):
        with pytest.raises(TargetError, match=f"--control is for a device that another .* {text}"):
            open_target(text, control="http://127.0.0.1:1")


def test_connect_rejects_an_unregistered_device(
    node: FakeCubeStar, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = Target("x", INTERFACE, over_i2c(node))
    monkeypatch.setattr(targets, "open_target", lambda *_of, **_how: target)
    with pytest.raises(TargetError, match="x: no registered device"):
        connect("x")


def test_missing_permission_for_a_bus_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_number: int) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(smbus2, "SMBus", refused)
    with pytest.raises(PortOpenError, match="can not open /dev/i2c-7: Permission denied"):
        open_target("i2c:7:0x1a")


def test_i2c_addresses_are_0x08_to_0x77() -> None:
    for text in ("i2c:7:0x07", "i2c:7:0x78", "i2c:-1:0x1a", "i2c:x", "i2c:7:x", "i2c:x:0x1a"):
        with pytest.raises(TargetError, match=f"{text}: must be i2c:BUS:ADDR, as in i2c:7:0x1a"):
            open_target(text, "cubestar")
    for address in ("0x08", "0x77"):
        with pytest.raises(PortOpenError, match="can not open /dev/i2c-250"):
            open_target(f"i2c:250:{address}", "cubestar")


def test_unsupported_operations_are_rejected(node: FakeCubeStar) -> None:
    client = DeviceClient(NodeClient(UartLink(node), INTERFACE))
    with pytest.raises(TargetError, match="CubeStar has no image upload"):
        client.upload(np.zeros((2, 2), np.uint8))
    with pytest.raises(TargetError, match="CubeStar looks for no stars"):
        client.stars()
    assert client.step_timeout_s == 10.0


@pytest.mark.parametrize("length", [127, 129, 0])
def test_stream_rejects_blocks_of_another_length(
    node: FakeCubeStar, monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    client = CubeStar(NodeClient(UartLink(node), INTERFACE))
    blocks = [bytes(128), bytes(length)]
    monkeypatch.setattr(client.client, "stream", lambda _name, _count: iter(blocks))
    told = list[tuple[int, int]]()
    with pytest.raises(BadAnswerError, match=f"block of {length} bytes, not 128"):
        client._stream("StreamDownImage", 2, 128, lambda *done: told.append(done))
    assert told == [(1, 2)]
    blocks[1] = b"x" * 128
    assert client._stream("StreamDownImage", 2, 128, None) == bytes(128) + b"x" * 128


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("write", "usage: write NAME"),
        ("write UploadBlock 0 xy", "field Data: 'xy' is not hexadecimal"),
        ("raw 00", "raw: x is no serial line"),
    ],
)
def test_shell_rejects_invalid_lines_over_i2c(node: FakeCubeStar, line: str, told: str) -> None:
    shell = Shell(Target("x", INTERFACE, over_i2c(node)))
    with pytest.raises(ValueError, match=told):
        shell.execute(line)


def test_bench_command_needs_a_bench_line(sense: Any) -> None:
    with pytest.raises(ShellError, match="no line with the bench protocol is open: give --bench"):
        Shell(Target("x", sense.interface, over_i2c(sense))).execute("bench q")


def test_unreadable_document_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"can not read .*none\.toml: No such file"):
        read_document(tmp_path / "none.toml")


def test_orbit_rejects_an_image_scene() -> None:
    looking: Any = SimpleNamespace(scene=object(), device=device("cubestar"))
    with pytest.raises(ValueError, match="cubestar looks at a picture, which follows no orbit"):
        _seen(SimpleNamespace(), looking)  # type: ignore[arg-type]


# --- experiments ----------------------------------------------------------------------------------


@compiled
@pytest.mark.parametrize(
    ("name", "mode", "told"),
    [
        ("cubestar", "assisted", "--mode assisted needs a scene whose attitude is known"),
        ("cubestar", "tracking", "--mode tracking needs a scene whose attitude is known"),
        ("aramis", "assisted", "--mode assisted needs a scene whose attitude is known"),
    ],
)
def test_assisted_mode_needs_a_known_attitude(
    name: str, mode: str, told: str, tmp_path: Path
) -> None:
    size = (512, 1024) if name == "cubestar" else (1024, 1280)
    Image.fromarray(np.zeros(size, np.uint8)).save(tmp_path / "p.png")
    with pytest.raises(ValueError, match=told):
        list(measure(name, image=tmp_path / "p.png", mode=mode))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["options", "grid", "random"])
def test_plan_sections_must_be_tables(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be a table of options"):
        CampaignPlan(device="cubestar", frames=1, **{name: [1]})  # type: ignore[arg-type]


def test_unknown_figures_and_commands_are_rejected(monkeypatch: pytest.MonkeyPatch) -> None:

    bare = replace(device("cubestar"), studies={})
    monkeypatch.setattr(fidelity, "registered", lambda _name: bare)
    with pytest.raises(ValueError, match="cubestar declares no published figures"):
        fidelity_of("cubestar")
    with pytest.raises(ValueError, match="cubestar has no command 'dance', only measure, "):
        experiment_of(device("cubestar"), "dance")


def test_missing_packages_name_their_extra(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("matplotlib.figure", "distributed"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ValueError, match="figures need matplotlib: pip install"):
        figure(1, 1)
    with pytest.raises(ValueError, match="figures need matplotlib"):
        save_curves({}, "", "", lambda _count, _of: (0, 1), tmp_path / "x.png")
    with pytest.raises(ValueError, match="needs distributed: pip install distributed"):
        workers._cluster("tcp://x").__enter__()
    monkeypatch.setattr(hazards, "find_spec", lambda _name: None)
    with pytest.raises(ValueError, match="--out: figures need matplotlib"):
        hazards.check_page(tmp_path)


@pytest.mark.parametrize(("threads", "told"), [({}, "has no workers"), ({"a": 2, "b": 3}, "")])
def test_cluster_without_workers_is_rejected(
    monkeypatch: pytest.MonkeyPatch, threads: dict[str, int], told: str
) -> None:
    class Client:
        def __init__(self, address: str, timeout: object) -> None:
            self.address = address

        def __enter__(self) -> "Client":
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def nthreads(self) -> dict[str, int]:
            return threads

        def get_executor(self, *, pure: bool) -> str:
            return f"executor, pure: {pure}"

    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=Client))
    if told:
        with pytest.raises(workers.WorkersError, match=f"scheduler at tcp://x {told}"):
            workers._cluster("tcp://x").__enter__()
        return
    with workers._cluster("tcp://x") as found:
        assert found == ("executor, pure: False", 5)


def test_upset_moments_are_uniform_in_a_phase() -> None:
    loop = [Interval("idle", 0, 10), Interval("storing", 10, 30), Interval("idle", 30, 60)]
    rng = np.random.default_rng(1)
    with pytest.raises(ValueError, match="a loop has no phase reading: "):
        upsets._moment(loop, "reading", rng)
    times = np.array([upsets._moment(loop, "idle", rng) for _ in range(2000)])
    assert np.all((times < 10) | ((times >= 30) & (times < 60)))
    assert np.mean(times < 10) == pytest.approx(0.25, abs=0.04)  # each moment as likely
    assert np.all([10 <= upsets._moment(loop, "storing", rng) < 30 for _ in range(100)])
