from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubesense.fpga import READ_OUTS
from cubestack.hdl.cubesense.tops import TOPS as PAIR_TOPS
from cubestack.hdl.cubestar.tops import TOPS
from cubestack.hdl.flow.tools import have_yosys, run_yosys
from cubestack.hdl.flow.top import tops_in
from cubestack.hdl.flow.verilog import verilog_file
from cubestack.host.emulation.emulated import open_device
from tests.system.conftest import Ear
from tests.system.life import life, pair_life
from tests.tiers import quick, todays

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


GATEWARE = tuple(READ_OUTS)
FILES = ("as_it_is.v", "rewritten.v")


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped design as Verilog, and as another tool rewrites it."""
    folder = tmp_path_factory.mktemp("exported")
    (folder / "as_it_is.v").write_text(verilog_file("cubestar", tops_in(TOPS)["cubestar"]))
    script = "read_verilog as_it_is.v\nhierarchy -auto-top\nproc\nflatten\ntribuf\nopt -full\n"
    run_yosys(f"{script}write_verilog -noattr rewritten.v\n", folder)
    return folder


@pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")
@pytest.mark.parametrize(("file", "turn"), quick([(f, n) for f in FILES for n in range(4)], 1))
def test_exported_verilog_does_not_change_the_run(file: str, turn: int, exported: Path) -> None:
    """But for the recording's header, which names the file, and the registers' order.

    A user's design may need pixels after ACK, so more frames are rendered, which the log shows.
    """
    seed = todays(turn, 4, 50)
    shipped, given = (
        life(seed, layouts="1", gateware=design, without="register-")
        for design in ("", str(exported / file))
    )
    for one in (shipped, given):
        one["recording"] = str(one["recording"]).splitlines()[1:]
        del one["registers"], one["faults"]
    assert given == shipped


@pytest.fixture(scope="module")
def rewritten_pair(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """Both FPGAs of a gateware that CubeSense is shipped with, as another tool rewrites them."""
    tops = tops_in(PAIR_TOPS)

    @cache
    def files(gateware: str) -> str:
        folder = tmp_path_factory.mktemp(gateware)
        for side in ("sun", "nadir"):
            variant = "" if gateware == "corrected" else f"-{gateware}"
            text = verilog_file(side, tops[f"cubesense-{side}{variant}"])
            (folder / f"{side}.v").write_text(text)
            script = (
                f"read_verilog {side}.v\nhierarchy -auto-top\nproc\nflatten\ntribuf\nopt -full\n"
            )
            run_yosys(f"{script}write_verilog -noattr {side}_rewritten.v\n", folder)
        return ",".join(f"{side}={folder / side}_rewritten.v" for side in ("sun", "nadir"))

    return files


# The Sun's FPGA with one search samples its pixels while it sends alone, which a notice says.
@pytest.mark.filterwarnings("default::cubestack.emulator.boards.gateware.GatewareNotice")
@pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")
@pytest.mark.parametrize(
    ("gateware", "turn"), quick([(gateware, n) for gateware in GATEWARE for n in range(3)], 1)
)
def test_rewritten_verilog_of_the_pair_does_not_change_the_run(
    gateware: str, turn: int, rewritten_pair: Callable[[str], str]
) -> None:
    seed = todays(turn, 3, 25)
    assert pair_life(seed, gateware, rewritten_pair(gateware)) == pair_life(seed, gateware)


@pytest.mark.parametrize("turn", quick(range(16), 2))
def test_strides_do_not_change_the_run(turn: int) -> None:
    seed = todays(turn, 16, 200)
    with_strides, exact = life(seed, strides=True), life(seed, strides=False)
    assert [name for name in exact if with_strides[name] != exact[name]] == [], f"seed {seed}"
    assert str(exact["recording"]).count("\n") > 4


@pytest.mark.parametrize(
    ("gateware", "turn"), quick([(gateware, n) for gateware in READ_OUTS for n in range(6)], 1)
)
def test_strides_do_not_change_the_run_of_the_pair(gateware: str, turn: int) -> None:
    seed = todays(turn, 6, 60)
    with_strides = pair_life(seed, gateware, upsets=True)
    without = pair_life(seed, gateware, strides=False, upsets=True)
    assert [name for name in without if with_strides[name] != without[name]] == [], f"seed {seed}"
