from collections.abc import Callable, Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.faults.table import FAULTS
from cubestack.emulator.scene.attitude import random_quaternion
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SkyScene
from cubestack.hdl.cubestar.tops import TOPS
from cubestack.hdl.flow.tools import have_yosys, run_yosys
from cubestack.hdl.flow.top import tops_in
from cubestack.hdl.flow.verilog import verilog_file
from cubestack.host.emulation.emulated import open_device
from cubestack.host.emulation.records import start_recorder
from cubestack.host.errors import HostError
from tests.system.conftest import Ear
from tests.tiers import quick

SKY = SkyScene.pointing(84, -1)
EARTH = EarthSunScene.facing(sun_deg=(20, 10), nadir_deg=(-8, 12), rate_deg_s=(0.5, -1.0, 2.0))

VIEWS: dict[str, tuple[Callable[[int], Any], list[str]]] = {
    "cubestar": (
        lambda seed: SkyView(SKY, replace(CONDITION, seed=seed)),
        ["CaptureAndProcess", "Trigger"],
    ),
    "cubesense": (
        lambda seed: EarthSunView(EARTH, FisheyeCondition(hot_pixels=20, seed=seed)),
        [],  # reading results makes others
    ),
}


def run(name: str, seed: int) -> tuple[dict[str, Any], list[bytes]]:
    """Traffic of a few captures and loop turns, and the final memories."""
    view, commands = VIEWS[name]
    with open_device(name, view(seed), seed=seed) as opened:
        ear, client = Ear(opened.board.uart), opened.client.client
        client.pause(0.3)
        for command in commands:
            client.command(command)
            client.pause(1.5)
        for _ in range(8):
            client.pause(0.1)
            for message in client.interface.telemetries:
                client.request(bytes([message.id]))
        return vars(ear), [memory.tobytes() for memory in opened.board.engine.memories.values()]


@pytest.mark.parametrize("name", quick(VIEWS, 1))
def test_same_seed_repeats_the_wire_to_the_picosecond(name: str) -> None:
    first, other = run(name, 1), run(name, 2)
    assert len(first[0]["sent"]) > 150
    assert run(name, 1) == first
    assert all(one != another for one, another in zip(first, other, strict=True))


LAYOUTS = ("1", "2", "3", "two-boards")
FAULTS_AT_ONCE = 3
LATEST_S = 1.2
QUICK = 6


def life(
    seed: int,
    *,
    strides: bool = True,
    layouts: Sequence[str] = LAYOUTS,
    gateware: str = "",
    without: str = "",
) -> dict[str, object]:
    """Traffic and final state of a random sky, board and faults; no kind ``without…``."""
    rng = np.random.default_rng(seed)
    scene = SkyScene(random_quaternion(rng), mag_limit=4.0, seed=seed)
    layout = layouts[int(rng.integers(len(layouts)))]
    design = {"gateware": gateware} if gateware else {}
    with open_device(
        "cubestar", scene, seed=seed, engine="compiled", layout=layout, **design
    ) as opened:
        opened.board.engine.use_strides(strides)
        recording = StringIO()
        recorder = start_recorder(opened, recording)
        kinds = [kind for kind, fault in FAULTS.items() if opened.faults.targets(fault.site)]
        kinds = [kind for kind in kinds if not (without and kind.startswith(without))]
        opened.faults.seed = seed
        for kind in rng.choice(kinds, FAULTS_AT_ONCE):
            targets = opened.faults.targets(FAULTS[kind].site)
            target = targets[int(rng.integers(len(targets)))]
            opened.faults.inject(str(kind), target=target, at_s=float(rng.uniform(0, LATEST_S)))
        client = opened.client.client
        for say, name, seconds in (
            (client.command, "CaptureAndProcess", 0.9),
            (client.telemetry, "ErrorFlags", 0.1),
            (client.telemetry, "DetectionSummary", 0.1),
            (client.command, "CaptureImage", 0.7),
        ):
            try:
                say(name)
            except HostError:
                client.pause(0.05)
            client.pause(seconds)
        recorder.close()
        board = opened.board
        return {
            "recording": recording.getvalue(),
            "memories": [memory.tobytes() for memory in board.sites().all_memories().values()],
            "violations": (board.engine.violations, dict(board.engine.violation_counts)),
            "registers": board.engine.state(),
            "faults": [str(event) for event in opened.faults.log],
            "now": board.kernel.now,
        }


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped design as Verilog, and as another tool rewrites it."""
    folder = tmp_path_factory.mktemp("exported")
    (folder / "as_it_is.v").write_text(verilog_file("cubestar", tops_in(TOPS)["cubestar"]))
    script = "read_verilog as_it_is.v\nhierarchy -auto-top\nproc\nflatten\ntribuf\nopt -full\n"
    run_yosys(f"{script}write_verilog -noattr rewritten.v\n", folder)
    return folder


@pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")
@pytest.mark.parametrize(
    ("file", "seed"), quick([(f, n) for f in ("as_it_is.v", "rewritten.v") for n in range(50)], 2)
)
def test_exported_verilog_does_not_change_the_run(file: str, seed: int, exported: Path) -> None:
    """But for the recording's header, which names the file, and the registers' order.

    A user's design may need pixels after ACK, so more frames are rendered, which the log shows.
    """
    shipped, given = (
        life(seed, layouts="1", gateware=design, without="register-")
        for design in ("", str(exported / file))
    )
    for one in (shipped, given):
        one["recording"] = str(one["recording"]).splitlines()[1:]
        del one["registers"], one["faults"]
    assert given == shipped


@pytest.mark.parametrize(
    "seed",
    [pytest.param(seed, marks=() if seed < QUICK else pytest.mark.slow) for seed in range(200)],
)
def test_strides_do_not_change_the_run(seed: int) -> None:
    quick, exact = life(seed, strides=True), life(seed, strides=False)
    assert [name for name in exact if quick[name] != exact[name]] == []
    assert str(exact["recording"]).count("\n") > 4
