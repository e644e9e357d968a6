import io
import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.boards.cubestar.layouts import fpga_of
from cubestack.emulator.recording.trace import VcdTrace
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubestar.codes import (
    ImageBlockSize,
    MemoryTest,
    TaskStatus,
    TestPattern,
)
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.host.cli.main import main
from cubestack.host.devices.registry import device
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.studies.cubestar.layouts import EXPERIMENT, LayoutResult
from tests.system.conftest import Emulate, Measure

ON_BUS = [layout for layout in Layout if layout is not Layout.COPIED]
ORION = replace(SkyScene.pointing(84, -1), mag_limit=3.8)
FULL = ImageBlockSize.BYTES_128.length


class Node:
    """A CubeStar with a memory layout, and its client."""

    def __init__(self, opened: AnyEmulated, layout: Layout) -> None:
        self.layout = layout
        self.board: CubeStarBoard = opened.board
        self.cubestar: Any = opened.client
        self.client = self.cubestar.client

    def do(self, command: str, **values: object) -> None:
        self.client.command(command, **values)
        self.client.wait_processed(10.0)

    def block(self, number: int) -> bytes:
        self.do("ImageBlockSet", BlockNumber=number, BlockSize=ImageBlockSize.BYTES_128)
        found: bytes = self.client.telemetry("ImageBlock")["Block"]
        return found

    def flags(self) -> set[str]:
        return {name for name, up in self.client.telemetry("ErrorFlags").items() if up}

    def seen(self) -> dict[str, Any]:
        """Telemetry of a capture without times and currents."""
        status, attitude = self.cubestar.capture_and_process(), self.cubestar.attitude()
        telemetry = ("DetectionSummary", "MatchSummary", "DetectionThresholdValues")
        return {name: self.client.telemetry(name) for name in telemetry} | {
            "status": status,
            "quaternion": attitude.quaternion.tolist(),
            "matched": attitude.matched,
            "stars": self.cubestar.stars(),
            "flags": self.flags(),
        }

    @property
    def memory(self) -> np.ndarray:
        """The memory with the first picture."""
        name = "SRAM" if self.layout is Layout.SHARED else "SRAM2"
        found: np.ndarray = self.board.engine.memories[name]
        return found


class Published:
    """What the published layout gives of the same sky.

    Attributes:
        seen: by the host.
        star: number of the block with the brightest pixel.
    """

    def __init__(self) -> None:
        with open_device("cubestar", ORION) as opened:
            node = Node(opened, Layout.COPIED)
            self.seen = node.seen()
            self.picture: np.ndarray = node.board.program._capture.memory.image.copy()
            self.star = int(self.picture.argmax()) // FULL
            assert node.block(self.star) == self.block(self.star)

    def block(self, number: int) -> bytes:
        return block_of(self.picture, number)


def block_of(picture: np.ndarray, number: int) -> bytes:
    return picture.tobytes()[number * FULL :][:FULL]


@pytest.fixture(scope="module")
def published() -> Published:
    return Published()


@pytest.fixture(params=ON_BUS, ids=lambda layout: layout.value)
def node(request: pytest.FixtureRequest) -> Iterator[Node]:
    with open_device("cubestar", ORION, layout=request.param.value) as opened:
        yield Node(opened, request.param)
        assert not opened.board.engine.violation_counts


only = pytest.mark.parametrize("node", [Layout.SHARED], indirect=True)


def test_layouts_return_the_same_bytes_and_attitude(node: Node, published: Published) -> None:
    assert node.seen() == published.seen
    phases = node.cubestar.phase_times()
    assert (phases["transfer"], phases["capture"]) == (0, pytest.approx(384, abs=1))
    assert published.seen["status"] is TaskStatus.CALCULATED
    assert np.array_equal(node.memory[: 1 << 19], published.picture.reshape(-1))
    star = published.star
    for number in (0, star - 8, star, star + 8, 4095):  # a row has eight
        assert node.block(number) == published.block(number)
    streamed = zip(range(40), node.client.stream("StreamDownImage", 4096), strict=False)
    assert all(block == published.block(number) for number, block in streamed)


def test_uploaded_and_test_pattern_images_are_in_memory(node: Node) -> None:
    rng = np.random.default_rng(4)
    picture = np.zeros((512, 1024), np.uint8)
    picture[100:102] = rng.integers(0, 256, (2, 1024))
    node.cubestar.upload_image(picture)
    assert b"".join(map(node.block, range(800, 816))) == picture[100:102].tobytes()
    node.do("CaptureTestPatern", TestPaternType=TestPattern.FIXED)
    drawn = (np.add.outer(np.arange(512), np.arange(1024)) % 256).astype(np.uint8)
    for number in range(4090, 4096):
        assert node.block(number) == block_of(drawn, number)


@only
def test_memory_test_takes_bus_time_and_finds_a_stuck_bit(node: Node) -> None:
    for expected in (MemoryTest.PASSED, MemoryTest.FAILED):
        began_ps = node.board.kernel.now
        node.do("TestSRAM")
        took_s = (node.board.kernel.now - began_ps) / 1e12
        assert node.client.telemetry("SRAMTestResults")["TestResult"] == expected
        if expected is MemoryTest.PASSED:
            assert took_s == pytest.approx(4 * (1 << 20) * (8 + 4) / 48e6, abs=0.05)
        node.board.faults.inject("memory-stuck", address=4711, bit=3, level=0)


def test_block_read_during_a_store_is_the_last_image_or_flagged(
    node: Node, published: Published
) -> None:
    node.cubestar.capture()
    last = node.block(published.star)
    assert last == published.block(published.star)
    node.client.command("CaptureImage")
    node.client.pause(0.2)
    block = node.client.telemetry("ImageBlock")["Block"]
    shared = node.layout is Layout.SHARED
    assert block == (bytes(FULL) if shared else last)
    assert node.flags() == ({"StatusError"} if shared else set())
    node.client.wait_processed(1.0)
    again = node.block(published.star)
    assert max(again) > 100
    assert again != last  # other noise


def test_lost_acknowledge_fails_one_capture(node: Node) -> None:
    for acknowledge in node.board.engine.wiring.acknowledges:
        node.board.faults.inject("ack-lost", target=acknowledge)
    assert node.cubestar.capture_and_process() is TaskStatus.CAPTURE_FAILED
    assert "ImageCaptureError" in node.flags()
    node.board.faults.clear()
    node.client.command("ClearErrorFlags")
    assert node.cubestar.capture_and_process() is TaskStatus.CALCULATED


def test_memory_latch_up_loses_only_the_image(node: Node, published: Published) -> None:
    node.cubestar.capture()
    assert node.block(published.star) == published.block(published.star)
    node.board.power.latch_up("memory")
    node.client.pause(0.5)
    assert node.flags() == {"OverCurrent"}
    assert node.board.power.is_on("memory")
    assert node.block(published.star) != published.block(published.star)
    assert node.cubestar.process_image() is TaskStatus.DETECTION_FAILED
    assert node.cubestar.capture_and_process() is TaskStatus.CALCULATED


def test_imager_latch_up_during_detection_loses_the_image(node: Node) -> None:
    node.cubestar.capture()
    picture = node.memory[: 1 << 19].copy()
    node.client.command("DetectStars")
    node.client.pause(0.005)
    node.board.power.latch_up("imager")
    node.client.wait_processed(5.0)
    node.client.pause(0.3)
    assert "OverCurrent" in node.flags()
    assert node.board.power.is_on("imager")
    assert node.client.telemetry("DetectionSummary")["NumStarsDetected"] < 20
    left = node.memory[: 1 << 19]
    changed = left != picture
    assert 0 < np.count_nonzero(changed) < 20 * 60
    assert not left[changed].any()
    assert node.cubestar.process_image() is TaskStatus.DETECTION_FAILED
    assert node.cubestar.capture_and_process() is TaskStatus.CALCULATED


def test_switched_off_board_returns_zeros(node: Node, published: Published) -> None:
    node.cubestar.capture()
    node.do("TogglePowerSW")
    assert node.block(published.star) == bytes(FULL)
    assert "StatusError" in node.flags()


def test_banks_are_separate(node: Node, published: Published) -> None:
    before = node.memory[: 1 << 19].copy()
    node.client.command("SelectImageBank", Bank=1)
    node.cubestar.capture()
    found = node.block(published.star)
    assert max(found) > 100
    if node.layout is not Layout.TWO_MEMORIES:
        assert np.array_equal(node.memory[: 1 << 19], before)
        assert block_of(node.memory[1 << 19 :], published.star) == found
    assert node.client.telemetry("LoopStatus")["Bank"] == 1


@pytest.mark.slow
def test_layouts_command_measures_loop_rate_and_attitude_age(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Two memories double the rate; attitudes without a copy are younger than 600 ms."""
    assert main(["layouts", "--seconds", "2", "--json", "--profile", "extended"]) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [json.loads(line) for line in lines]
    assert {row.pop("profile") for row in rows} == {"extended"}
    results = [LayoutResult(**row) for row in rows]
    assert [result.layout for result in results] == [layout.value for layout in Layout]
    for result in results:
        hz = 2 if result.layout in ("3", "two-boards") else 1
        assert result.rate_hz == pytest.approx(hz, rel=1e-3)
        assert result.attitudes == result.right == 2 * hz
        copied = result.layout == "1"
        assert result.age_ms is not None
        assert result.age_ms > 900 if copied else result.age_ms < 600
        assert (result.phase_ms["transfer"] > 0) == copied
        assert result.violations == 0
        assert result.energy_mj is not None
        assert result.power_mw == pytest.approx(result.energy_mj * hz, rel=2e-3)
        assert all(EXPERIMENT.row(0, result))
    *told, last = EXPERIMENT.summarise(results, wall_s=1.0)
    assert [line.split(": ")[1] for line in told] == [result.published for result in results]
    assert "layout 3 can't be built" in last


@pytest.mark.parametrize("node", [Layout.TWO_MEMORIES], indirect=True)
def test_captures_alternate_between_two_memories(node: Node) -> None:
    into = []
    set_pin = node.board.engine.set_pin

    def watched(name: str, level: int) -> None:
        if name == "INTO":
            into.append(level)
        set_pin(name, level)

    node.board.engine.set_pin = watched
    node.client.command("Trigger")
    node.client.pause(2.2)
    assert len(into) >= 4
    assert all(later != earlier for earlier, later in pairwise(into))


def test_only_option_3_needs_too_many_pins() -> None:
    fpgas = {layout: fpga_of(layout) for layout in Layout}
    assert [layout for layout, fpga in fpgas.items() if not fpga.fits] == [Layout.TWO_MEMORIES]
    assert [fpga.pins for fpga in fpgas.values()] == [55, 66, 95, 66]


def test_commands_print_a_notice_for_layouts_that_cannot_be_built(
    measure: Measure, emulate: Emulate
) -> None:
    option = next(one for one in device("cubestar").options if one.name == "layout")
    (line,) = filter(None, map(option.notice, option.choices))
    assert "layout 3 can't be built with an AGLN030: its FPGA takes 95 pins of 77" in line
    (frame,) = measure("--layout", "3", "--mag-limit", 3.8)
    assert frame["phase_ms"]["transfer"] == 0
    with emulate("--layout", "two-boards", "--tcp", "0") as served:
        assert served.port


@pytest.mark.parametrize(("layout", "code"), [("two-boards", 0), ("9", 2)])
def test_replay_uses_the_recorded_layout(
    layout: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.rec"
    setup = {"version": "0.1.0", "seed": 0, "options": {"layout": layout}}
    header = {"recording": 1, "device": "cubestar", "lines": {"uart": 57600}, "setup": setup}
    path.write_text(json.dumps(header) + "\n", encoding="utf-8")
    assert main(["replay", str(path)]) == code
    if code:
        assert "'9' is none of the layouts 1, 2, 3, two-boards" in capsys.readouterr().err


def test_trace_has_the_bus_pins(node: Node) -> None:
    stream, board = io.StringIO(), node.board
    trace = VcdTrace(stream, "cubestar", board.kernel, board.uarts, board.engine, board.probes)
    node.cubestar.capture()
    for number in range(3):
        node.block(number)
    trace.close()
    lines = stream.getvalue().splitlines()
    symbols = {line.split()[4]: line.split()[3] for line in lines if line.startswith("$var")}
    assert symbols.keys() >= {"ALE", "RE_N", "AD_HIGH"}
    assert sum(line.endswith(f" {symbols['AD_HIGH']}") for line in lines) > 1
