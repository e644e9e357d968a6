from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.aramis.board import AramisBoard
from cubestack.emulator.boards.contract import Board
from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.emulator.bus.i2c import I2cBus, I2cMessage
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.ports.line import HostLine
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS, Kernel
from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.host.clients.quaternions import attitude_columns
from cubestack.host.emulation.emulated import AnyEmulated, open_device

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

SKY = SkyScene([0, 0, 0, 1], mag_limit=1)
EARTH = EarthSunScene()

BOARDS: dict[str, Callable[..., Board]] = {
    "cubestar": lambda **place: CubeStarBoard(SKY, onboard_catalogue(), seed=3, **place),
    "cubesense": lambda **place: CubeSenseBoard(EARTH, seed=3, **place),
    "aramis": lambda **place: AramisBoard(SKY, None, seed=3, **place),
}
INTERFACES = {"cubestar": CUBESTAR, "cubesense": CUBESENSE, "aramis": ARAMIS}


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as opened:
        yield opened


def powered(stack: ExitStack, **place: Any) -> dict[str, Board]:
    boards = {name: make(**place) for name, make in BOARDS.items()}
    for board in boards.values():
        stack.callback(board.close)
    return boards


def probed(board: Board, name: str) -> list[tuple[int, object]]:
    """Answers to a telemetry on both ways to a board, asked at once, and when the bytes come."""
    kernel, address = board.kernel, INTERFACES[name].i2c_address
    request = bytearray([INTERFACES[name].telemetries[0].id])
    line, answer = HostLine(board.uart), bytearray()
    transfer = [I2cMessage(address, request), I2cMessage(address, read=4)]
    found: list[tuple[int, object]] = []

    def host() -> Iterator[Any]:
        yield kernel.timeout(100 * PS_PER_MS)
        line.uart.host_writes(encode_frame(bytes(request)))
        yield from board.i2c_bus.transfer(transfer)
        found.append((kernel.now, bytes(transfer[1].data)))
        for _ in range(40):
            yield kernel.timeout(PS_PER_MS)
            answer.extend(line.take(kernel.now, 100))
            found.append((kernel.now, bytes(answer)))

    kernel.process(host())
    return found


def test_boards_sharing_a_kernel_behave_as_they_do_alone(stack: ExitStack) -> None:
    """Each on a bus of its own: on one bus they would wait for each other."""
    alone = []
    for name, board in powered(stack).items():
        alone.append(probed(board, name))
        board.kernel.advance_to(200 * PS_PER_MS)
    kernel = Kernel()
    together = [probed(board, name) for name, board in powered(stack, kernel=kernel).items()]
    kernel.advance_to(200 * PS_PER_MS)
    assert together == alone
    assert all(len(found[-1][1]) > 8 for found in alone)


def test_boards_share_a_bus(stack: ExitStack) -> None:
    kernel = Kernel()
    bus = I2cBus(kernel)
    powered(stack, kernel=kernel, i2c_bus=bus)
    assert sorted(bus.targets) == [0x1A, 0x1B, 0x1C, 0x1D]
    with pytest.raises(ValueError, match="0x1d is already in use"):
        BOARDS["aramis"](kernel=kernel, i2c_bus=bus)


def test_rejects_foreign_bus_and_running_kernel() -> None:
    with pytest.raises(ValueError, match="needs the kernel of that bus"):
        BOARDS["aramis"](i2c_bus=I2cBus(Kernel()))
    kernel = Kernel()
    kernel.advance_to(5)
    with pytest.raises(ValueError, match="powered up at time 0, not at 5 ps"):
        BOARDS["aramis"](kernel=kernel)


def test_scenes_change_while_boards_run(stack: ExitStack) -> None:
    boards = powered(stack)
    for name, other in (("cubestar", SKY.rotate((1, 0, 0))), ("aramis", SKY)):
        boards[name].scene = other
        assert boards[name].scene is other
        with pytest.raises(TypeError, match="is a sky or a picture, not EarthSunScene"):
            boards[name].scene = EARTH
    with pytest.raises(TypeError, match="nadir sensor is Earth and Sun, not SkyScene"):
        boards["cubesense"].scene = SKY


def test_boards_declare_their_lines_and_probes(stack: ExitStack) -> None:
    boards = powered(stack)
    latest = "sun_capture", "sun_detect", "nadir_capture", "nadir_detect"
    assert {name: [*board.uarts, *board.probes()] for name, board in boards.items()} == {
        "cubestar": ["uart", "awake", "resets", "task"],
        "cubesense": [*("uart", "bench_uart", "awake", "resets"), *latest],
        "aramis": ["uart", "awake", "resets", "task", "measurement"],
    }


def test_pending_work_finishes_before_the_board_closes() -> None:
    board, done = BOARDS["cubestar"](), []
    close = board.engine.close
    board.engine.close = lambda: (done.append("engine"), close())[1]  # type: ignore[method-assign]
    board.on_close += [lambda: done.append("first"), lambda: done.append("second")]
    board.close()
    assert done == ["first", "second", "engine"]


SHAPES = {"cubestar": (512, 1024), "cubesense": (480, 640), "aramis": (1024, 1280)}


def take(name: str, emulated: AnyEmulated) -> None:
    client: Any = emulated.client
    if name == "cubesense":
        for camera, memory in zip(Camera, Sram, strict=True):
            client.capture_and_detect(camera, memory)
    else:
        client.take_picture()


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_image_equals_the_one_sent_by_the_device(name: str) -> None:
    with open_device(name) as emulated:
        take(name, emulated)
        sent = emulated.client.picture()
        shown = emulated.board.pictures().values()
        assert any(np.array_equal(picture, sent) for picture in shown)


@pytest.mark.parametrize("name", SHAPES)
def test_memories_contain_the_captured_image(name: str) -> None:
    with open_device(name) as emulated:
        before = {at: picture.copy() for at, picture in emulated.board.pictures().items()}
        take(name, emulated)
        after = emulated.board.pictures()
        assert {picture.shape for picture in after.values()} == {SHAPES[name]}
        changed = [at for at in after if not np.array_equal(before[at], after[at])]
        assert len(changed) == (2 if name == "cubesense" else 1)
        truths = emulated.board.truths()
        if name == "cubesense":
            assert set(truths) == {"sun", "nadir"}
            found = emulated.client.latest()
            for camera, (alpha, beta) in truths.items():
                assert found[f"{camera}_alpha_deg"] == pytest.approx(alpha, abs=1.0)
                assert found[f"{camera}_beta_deg"] == pytest.approx(beta, abs=1.0)
        else:
            assert set(truths) == {"attitude"}
            assert attitude_columns(truths["attitude"])["dec_deg"] is not None


def test_truth_is_empty_before_the_first_image() -> None:
    with open_device("cubestar") as emulated:
        assert emulated.board.truths() == {}
