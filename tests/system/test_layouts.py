"""CubeStar's further memory layouts, whole: the host sees what it sees of the published one."""

import io
import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.layouts import fpga_of
from cubestack.emulator.recording.trace import VcdTrace
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubestar.codes import (
    ImageBlockSize,
    MemoryTest,
    TaskStatus,
    TestPattern,
)
from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.host.cli.main import main
from cubestack.host.devices.emulated import AnyEmulated, open_device
from cubestack.host.devices.registry import device
from cubestack.host.experiments.cubestar.layouts import EXPERIMENT, LayoutResult

ON_BUS = [layout for layout in Layout if layout is not Layout.COPIED]
ORION = SkyScene(quaternion_from_pointing(84.0, -1.0, 0.0), mag_limit=3.8)
FULL = ImageBlockSize.BYTES_128.length

Open = Callable[..., AbstractContextManager[AnyEmulated]]


def blocks(node: AnyEmulated, numbers: range) -> bytes:
    """Blocks of the picture, read in interrupts."""
    client, found = node.client.client, b""
    for number in numbers:
        client.command("ImageBlockSet", BlockNumber=number, BlockSize=ImageBlockSize.BYTES_128)
        client.wait_processed(1.0)
        found += client.telemetry("ImageBlock")["Block"]
    return found


def flags(node: AnyEmulated) -> set[str]:
    return {name for name, up in node.client.client.telemetry("ErrorFlags").items() if up}


def seen(node: AnyEmulated) -> dict[str, Any]:
    """All that a host gets of one capture, but for times and currents."""
    status = node.client.capture_and_process()
    client = node.client.client
    found = {
        name: client.telemetry(name)
        for name in ("DetectionSummary", "MatchSummary", "DetectionThresholdValues")
    }
    attitude = node.client.attitude()
    return {
        **found,
        "status": status,
        "quaternion": attitude.quaternion.tolist(),
        "matched": attitude.matched,
        "stars": node.client.stars(),
        "flags": flags(node),
    }


@pytest.fixture(params=ON_BUS, ids=lambda layout: layout.value)
def layout(request: pytest.FixtureRequest) -> Layout:
    found: Layout = request.param
    return found


@pytest.fixture
def node(session: Open, layout: Layout) -> Iterator[AnyEmulated]:
    with session(ORION, layout=layout.value) as opened:
        yield opened


@pytest.fixture(scope="module")
def published() -> dict[str, Any]:
    with open_device("cubestar", ORION) as opened:
        found = seen(opened)
        picture: np.ndarray = opened.board.program._capture.pictures.image.copy()
        star = int(picture.argmax()) // FULL
        assert blocks(opened, range(star, star + 1)) == block_of(picture, star)
    return found | {"picture": picture, "star": star}


def block_of(picture: np.ndarray, number: int) -> bytes:
    return picture.tobytes()[number * FULL :][:FULL]


def newest(node: AnyEmulated, layout: Layout) -> np.ndarray:
    """The picture of the first capture, where the layout has it."""
    name = "SRAM" if layout is Layout.SHARED else "SRAM2"
    return node.board.engine.memories[name][: 512 * 1024]


def test_the_same_scene_gives_the_same_bytes_and_attitude(
    node: AnyEmulated, layout: Layout, published: dict[str, Any]
) -> None:
    """Detected over the bus, zeroed and written back there, and downloaded in two ways."""
    found = seen(node)
    assert found == {name: published[name] for name in found}
    assert found["status"] is TaskStatus.CALCULATED
    picture, star = published["picture"], published["star"]
    assert np.array_equal(newest(node, layout), picture.reshape(-1))
    for number in (0, star - 8, star, star + 8, 4095):  # a row has eight
        assert blocks(node, range(number, number + 1)) == block_of(picture, number)
    streamed = zip(range(40), node.client.client.stream("StreamDownImage", 4096), strict=False)
    assert all(block == block_of(picture, number) for number, block in streamed)
    assert not node.board.engine.violation_counts


def test_nothing_is_copied(node: AnyEmulated) -> None:
    node.client.capture()
    phases = node.client.phase_times()
    assert phases["transfer"] == 0
    assert phases["capture"] == pytest.approx(384, abs=1)


def test_uploaded_and_drawn_pictures_are_in_memory(node: AnyEmulated) -> None:
    rng = np.random.default_rng(4)
    picture = np.zeros((512, 1024), np.uint8)
    picture[100:102] = rng.integers(0, 256, (2, 1024))
    node.client.upload_image(picture)
    assert blocks(node, range(800, 816)) == picture[100:102].tobytes()
    node.client.client.command("CaptureTestPatern", TestPaternType=TestPattern.DIAGONAL_RAMP)
    node.client.client.wait_processed(5.0)
    expected = (np.add.outer(np.arange(512), np.arange(1024)) % 256).astype(np.uint8)
    assert blocks(node, range(4090, 4096)) == expected.tobytes()[-6 * FULL :]


@pytest.mark.parametrize("layout", [Layout.SHARED])
def test_memory_test_passes_and_takes_the_bus_s_time(node: AnyEmulated) -> None:
    began_ps = node.board.kernel.now
    node.client.client.command("TestSRAM")
    node.client.client.wait_processed(10.0)
    took_s = (node.board.kernel.now - began_ps) / 1e12
    result = node.client.client.telemetry("SRAMTestResults")["TestResult"]
    assert result == MemoryTest.PASSED
    assert took_s == pytest.approx(4 * (1 << 20) * (8 + 5) / 48e6, abs=0.05)
    assert not node.board.engine.violation_counts


@pytest.mark.parametrize("layout", [Layout.SHARED])
def test_a_bit_that_does_not_hold_is_found(node: AnyEmulated) -> None:
    node.board.faults.inject("memory-stuck", address=4711, bit=3, level=0)
    node.client.client.command("TestSRAM")
    node.client.client.wait_processed(10.0)
    result = node.client.client.telemetry("SRAMTestResults")["TestResult"]
    assert result == MemoryTest.FAILED


def test_while_a_picture_is_stored_the_last_one_is_there_or_a_flag_is_up(
    node: AnyEmulated, layout: Layout, published: dict[str, Any]
) -> None:
    node.client.capture()
    star, client = published["star"], node.client.client
    client.command("ImageBlockSet", BlockNumber=star, BlockSize=ImageBlockSize.BYTES_128)
    client.wait_processed(1.0)
    client.command("CaptureImage")
    client.pause(0.2)
    block = client.telemetry("ImageBlock")["Block"]
    if layout is Layout.SHARED:
        assert not any(block)
        assert flags(node) == {"StatusError"}
    else:
        assert block == block_of(published["picture"], star)
        assert not flags(node)
    client.wait_processed(1.0)
    again = np.frombuffer(blocks(node, range(star, star + 1)), np.uint8)
    assert np.abs(again.astype(int) - np.frombuffer(block, np.uint8)).max() > 0  # other noise
    assert again.max() > 100
    assert not node.board.engine.violation_counts


def test_a_lost_acknowledge_fails_the_capture_and_the_next_one_is_good(node: AnyEmulated) -> None:
    for acknowledge in node.board.engine.wiring.acknowledges:
        node.board.faults.inject("ack-lost", target=acknowledge)
    assert node.client.capture_and_process() is TaskStatus.CAPTURE_FAILED
    assert "ImageCaptureError" in flags(node)
    node.board.faults.clear()
    node.client.client.command("ClearErrorFlags")
    assert node.client.capture_and_process() is TaskStatus.CALCULATED


def test_a_latch_up_of_the_memory_loses_the_picture_only(
    node: AnyEmulated, layout: Layout, published: dict[str, Any]
) -> None:
    star = published["star"]
    node.client.capture()
    assert blocks(node, range(star, star + 1)) == block_of(published["picture"], star)
    node.board.power.latch_up("memory")
    node.client.client.pause(0.5)
    assert flags(node) == {"OverCurrent"}
    assert node.board.power.is_on("memory")
    assert blocks(node, range(star, star + 1)) != block_of(published["picture"], star)
    assert node.client.process_image() is TaskStatus.DETECTION_FAILED
    assert node.client.capture_and_process() is TaskStatus.CALCULATED


def test_a_latch_up_of_the_boards_in_a_search_costs_the_picture(
    node: AnyEmulated, layout: Layout
) -> None:
    """Nothing is found from there on, and what was found stays zero."""
    node.client.capture()
    picture = newest(node, layout).copy()
    client, power = node.client.client, node.board.power
    client.command("DetectStars")
    client.pause(0.005)
    power.latch_up("imager")
    client.wait_processed(5.0)
    client.pause(0.3)
    assert "OverCurrent" in flags(node)
    assert power.is_on("imager")
    assert client.telemetry("DetectionSummary")["NumStarsDetected"] < 20
    left = newest(node, layout)
    changed = left != picture
    assert 0 < np.count_nonzero(changed) < 20 * 60
    assert not left[changed].any()
    assert node.client.process_image() is TaskStatus.DETECTION_FAILED
    assert node.client.capture_and_process() is TaskStatus.CALCULATED
    assert not node.board.engine.violation_counts


def test_a_switched_off_board_has_no_picture_to_give(
    node: AnyEmulated, published: dict[str, Any]
) -> None:
    star = published["star"]
    node.client.capture()
    node.client.client.command("TogglePowerSW")
    node.client.client.wait_processed(1.0)
    assert blocks(node, range(star, star + 1)) == bytes(FULL)
    assert "StatusError" in flags(node)


def test_banks_are_kept_apart_where_there_are_any(
    node: AnyEmulated, layout: Layout, published: dict[str, Any]
) -> None:
    star = published["star"]
    before = newest(node, layout).copy()
    node.client.client.command("SelectImageBank", Bank=1)
    node.client.capture()
    found = blocks(node, range(star, star + 1))
    assert max(found) > 100
    if layout is not Layout.TWO_MEMORIES:
        assert np.array_equal(newest(node, layout), before)
        whole = node.board.engine.memories["SRAM" if layout is Layout.SHARED else "SRAM2"]
        assert block_of(whole[1 << 19 :], star) == found
    assert node.client.client.telemetry("LoopStatus")["Bank"] == 1


def test_the_loops_keep_their_rate_and_age(capsys: pytest.CaptureFixture[str]) -> None:
    """Twice the rate with two memories; no layout without a copy is older than 500 ms."""
    capsys.readouterr()
    assert main(["layouts", "--seconds", "2", "--json"]) == 0
    lines = capsys.readouterr().out.splitlines()
    results = [LayoutResult(**json.loads(line)) for line in lines]
    assert [result.layout for result in results] == [layout.value for layout in Layout]
    for result in results:
        fast = result.layout in ("3", "two-boards")
        assert result.rate_hz == pytest.approx(2 if fast else 1, rel=1e-3)
        assert result.attitudes == result.right == (4 if fast else 2)
        copied = result.layout == "1"
        assert result.age_ms is not None
        assert result.age_ms > 900 if copied else result.age_ms < 500
        assert (result.phase_ms["transfer"] > 0) == copied
        assert result.violations == 0
        assert result.energy_mj is not None
        assert result.rate_hz is not None
        assert result.power_mw == pytest.approx(result.energy_mj * result.rate_hz, rel=1e-3)
    for result in results:
        assert all(part for part in EXPERIMENT.row(0, result))
    told = list(EXPERIMENT.summarise(results, wall_s=1.0))
    assert [line.split(": ")[1] for line in told[: len(results)]] == [r.published for r in results]
    (line,) = told[len(results) :]
    assert "layout 3 can not be built" in line


def test_two_memories_are_filled_in_turn(session: Open) -> None:
    """And the one that is not stored in is worked on, beside the pixels."""
    with session(ORION, layout=Layout.TWO_MEMORIES.value) as node:
        into = []
        set_pin = node.board.engine.set_pin

        def watched(name: str, level: int) -> None:
            if name == "INTO":
                into.append(level)
            set_pin(name, level)

        node.board.engine.set_pin = watched  # type: ignore[method-assign]
        node.client.client.command("Trigger")
        node.client.client.pause(2.2)
        assert len(into) >= 4
        assert all(later != earlier for earlier, later in pairwise(into))


def test_only_option_3_needs_too_many_pins() -> None:
    fpgas = {layout: fpga_of(layout) for layout in Layout}
    assert [layout for layout, fpga in fpgas.items() if not fpga.fits] == [Layout.TWO_MEMORIES]
    assert [fpga.pins for fpga in fpgas.values()] == [55, 66, 95, 66]


def test_the_commands_say_what_can_not_be_built(
    capsys: pytest.CaptureFixture[str], emulate: Callable[..., Any]
) -> None:
    (option,) = device("cubestar").options
    (line,) = filter(None, map(option.notice, option.choices))
    assert "layout 3 can not be built with an AGLN030: its FPGA takes 95 pins of 77" in line
    capsys.readouterr()
    arguments = ["measure", "cubestar", "--layout", "3", "--mag-limit", "3.8"]
    assert main([*arguments, "--json"]) == 0
    output = capsys.readouterr()
    assert output.err == ""
    assert json.loads(output.out)["phase_ms"]["transfer"] == 0
    with emulate("--layout", "two-boards", "--tcp", "0") as served:
        assert served.port


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (
            ("measure", "cubestar", "--layout", "4"),
            "invalid choice: '4' (choose from '1', '2', '3', 'two-boards')",
        ),
        (("emulate", "cubesense", "--tcp", "0", "--layout", "2"), "option of cubestar, not of"),
    ],
)
def test_other_layouts_are_refused_in_one_line(
    arguments: tuple[str, ...], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(list(arguments))
    except SystemExit as ended:
        code = int(ended.code or 0)
    error = capsys.readouterr().err
    assert code == 2
    assert text in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(("layout", "code"), [("two-boards", 0), ("9", 2)])
def test_a_recording_says_which_layout_it_is_of(
    layout: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.rec"
    setup = {"version": "0.1.0", "seed": 0, "options": {"layout": layout}}
    header = {"recording": 1, "device": "cubestar", "lines": {"uart": 57600}, "setup": setup}
    path.write_text(json.dumps(header) + "\n", encoding="utf-8")
    assert main(["replay", str(path)]) == code
    if code:
        assert "'9' is none of the layouts 1, 2, 3, two-boards" in capsys.readouterr().err


def test_a_trace_shows_the_bus(node: AnyEmulated) -> None:
    stream = io.StringIO()
    board = node.board
    trace = VcdTrace(
        stream, "cubestar", board.kernel, {"uart": board.uart}, board.engine, board.probes
    )
    node.client.capture()
    blocks(node, range(3))
    trace.close()
    lines = stream.getvalue().splitlines()
    symbols = {line.split()[4]: line.split()[3] for line in lines if line.startswith("$var")}
    for pin in ("ALE", "RE_N", "AD_HIGH"):
        assert pin in symbols
    changes = [line for line in lines if line.endswith(f" {symbols['AD_HIGH']}")]
    assert len(changes) > 1
