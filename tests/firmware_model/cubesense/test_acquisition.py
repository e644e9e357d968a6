from collections.abc import Iterator
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.acquisition import (
    ACK_TIMEOUT_US,
    CHUNK,
    SAMPLE_BYTES,
    Acquisition,
)
from cubestack.firmware_model.cubesense.state import State
from cubestack.firmware_model.cubesense.supply import SAMPLE_US, Supply
from cubestack.firmware_model.cubesense.vision.edges import EdgeConfig, NadirLines
from cubestack.firmware_model.cubesense.vision.sample_search import around_samples
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, Sram
from cubestack.firmware_model.interface.cubesense.fpga import Action, Actions, actions
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20
from cubestack.firmware_model.mcu.requests import Request, SetPin, StrobeRead

from .harness import FRAME_US, READ_OUT_US, Harness, stored
from .scenery import COLUMNS, ROWS, earth, edges_in, sun, window


class Rig(Harness):
    def __init__(self, *, mcu_addressing: bool = False) -> None:
        super().__init__(mcu_addressing=mcu_addressing)
        supply = Supply(self, self.meter, State())
        self.acquisition = Acquisition(self, self.meter, supply)
        self.perform(supply.start())
        rng = np.random.default_rng(3)
        for sram in Sram:
            self.memories[sram] = rng.integers(0, 256, (ROWS, COLUMNS), np.uint8)
        self.log.clear()

    def store(self, camera: Camera, sram: Sram) -> CaptureResult:
        return self.perform(self.acquisition.store(camera, sram))

    def entered(self) -> list[Actions]:
        """Rows of the command table that the log went through, standby left out."""
        levels = {"SHIFT": 0, "EDGE": 0, "RNW": 0, "SUNEN": 1, "NADEN": 1}
        rows = []
        for _, request in self.log:
            if isinstance(request, SetPin) and request.pin in levels:
                levels[request.pin] = request.level
                row = actions(*levels.values())
                if row != Actions(Action.STANDBY, Action.STANDBY) and row not in rows[-1:]:
                    rows.append(row)
        return rows


@pytest.fixture
def rig() -> Rig:
    return Rig()


S = Action.STANDBY
IMAGE_BYTES = ROWS * COLUMNS


@pytest.mark.parametrize(
    ("camera", "sram", "row"),
    [
        (Camera.SUN, Sram.SRAM1, Actions(Action.STORE, S)),
        (Camera.NADIR, Sram.SRAM2, Actions(S, Action.STORE)),
        (Camera.SUN, Sram.SRAM2, Actions(Action.SEND_PICTURE, Action.STORE_OTHER)),
        (Camera.NADIR, Sram.SRAM1, Actions(Action.STORE_OTHER, Action.SEND_PICTURE)),
    ],
)
def test_image_is_stored_in_the_selected_memory(
    rig: Rig, camera: Camera, sram: Sram, row: Actions
) -> None:
    rig.scenes[camera] = picture = earth(0, 0)
    other = Sram(1 - sram)
    kept = rig.memories[other].copy()
    assert rig.store(camera, sram) is stored(camera, sram)
    assert np.array_equal(rig.memories[sram], picture)
    assert np.array_equal(rig.memories[other], kept)
    assert rig.entered()[-1] == row
    assert rig.pins["SUNEN"] == rig.pins["NADEN"] == 1


@pytest.mark.parametrize("sram", Sram)
def test_dead_camera_times_out_after_two_frames_and_keeps_the_memory(rig: Rig, sram: Sram) -> None:
    rig.scenes[Camera.SUN] = None
    kept = rig.memories[sram].copy()
    start_us = rig.now_us
    assert rig.store(Camera.SUN, sram) is CaptureResult.CAMERA_TIMEOUT
    assert 2 * FRAME_US < rig.now_us - start_us < ACK_TIMEOUT_US + 300
    assert np.array_equal(rig.memories[sram], kept)
    assert rig.pins["SUNEN"] == rig.pins["NADEN"] == 1


def test_longest_wait_for_a_live_camera_does_not_time_out(rig: Rig) -> None:
    rig.wait_us = 2 * FRAME_US - READ_OUT_US
    assert rig.store(Camera.SUN, Sram.SRAM1) is CaptureResult.STORED_OWN_SRAM


@pytest.mark.parametrize("camera", Camera)
def test_a_latch_up_ends_the_wait_at_once(rig: Rig, camera: Camera) -> None:
    rig.latched.add(Sram.SRAM2)
    start_us = rig.now_us
    assert rig.store(camera, Sram.SRAM2) is CaptureResult.SRAM_OVER_CURRENT
    assert rig.now_us - start_us < SAMPLE_US + 200
    assert rig.cut() == {Sram.SRAM2}
    rig.log.clear()
    assert rig.store(camera, Sram.SRAM2) is CaptureResult.SRAM_OVER_CURRENT
    assert rig.log == []  # nothing is tried with a memory that is off


def test_latch_up_of_the_other_memory_does_not_disturb_a_store(rig: Rig) -> None:
    rig.latched.add(Sram.SRAM2)
    assert rig.store(Camera.SUN, Sram.SRAM1) is CaptureResult.STORED_OWN_SRAM
    assert rig.cut() == {Sram.SRAM2}


@pytest.mark.parametrize("sram", Sram)
def test_nadir_scan_reads_from_either_memory(rig: Rig, sram: Sram) -> None:
    rig.memories[sram] = picture = earth(5, 5)
    lines = NadirLines(EdgeConfig(), rig.meter, buffer=rig.acquisition.buffers[0])
    assert rig.perform(rig.acquisition.scan(sram, lines)) is True
    assert len(lines.edges) > 10
    assert np.array_equal(lines.edges.points, edges_in(picture, rig.meter).points)
    assert lines.wanted == 0
    linked = Actions(Action.SEND_EDGE, Action.PASS_EDGE)
    assert rig.entered() == [linked if sram is Sram.SRAM1 else Actions(S, Action.EDGE)]


@pytest.mark.parametrize("sram", Sram)
def test_sun_window_is_read_from_either_memory(rig: Rig, sram: Sram) -> None:
    rig.memories[sram] = picture = sun(np.array([300.0, 200.0]), 6)
    data = rig.perform(rig.acquisition.window(sram))
    assert np.array_equal(data, window(picture))
    linked = Actions(Action.PASS_EDGE, Action.SEND_EDGE)
    assert rig.entered() == [linked if sram is Sram.SRAM2 else Actions(Action.EDGE, S)]


def latch_after(unit: Harness, sram: Sram, strobed: int) -> None:
    seen = 0

    def count(request: Request) -> None:
        nonlocal seen
        if isinstance(request, StrobeRead):
            seen += len(request.target)
            if seen >= strobed:
                unit.latched.add(sram)

    unit.on_request = count


def test_a_latch_up_is_noticed_before_the_next_line_is_read(rig: Rig) -> None:
    latch_after(rig, Sram.SRAM2, 3000)
    lines = NadirLines(EdgeConfig(), rig.meter)
    assert rig.perform(rig.acquisition.scan(Sram.SRAM2, lines)) is False
    read = [len(r.target) for _, r in rig.log if isinstance(r, StrobeRead)]
    assert 3000 <= sum(read) <= 3000 + SAMPLE_BYTES + CHUNK
    assert rig.cut() == {Sram.SRAM2}
    assert rig.pins["SUNEN"] == rig.pins["NADEN"] == 1


def test_latch_up_during_the_sun_window_read_returns_none(rig: Rig) -> None:
    latch_after(rig, Sram.SRAM1, 1)
    assert rig.perform(rig.acquisition.window(Sram.SRAM1)) is None


def parts(rng: np.random.Generator) -> Iterator[tuple[int, int]]:
    """How much to skip and to read, up to the picture's end."""
    at = 0
    while at < IMAGE_BYTES:
        skip = int(min(rng.choice([0, 1, 3, 700, 20_000]), IMAGE_BYTES - at))
        read = int(min(rng.choice([0, 1, 63, 64, 65, 1500]), IMAGE_BYTES - at - skip))
        at += skip + read
        yield skip, read


@pytest.mark.parametrize("mcu_addressing", [False, True])
@pytest.mark.parametrize("sram", Sram)
def test_image_is_read_and_skipped_in_parts(sram: Sram, mcu_addressing: bool) -> None:
    rig = Rig(mcu_addressing=mcu_addressing)
    acquisition, picture = rig.acquisition, rig.memories[sram].reshape(-1)
    assert rig.perform(acquisition.open_image(sram)) is True
    at = 0
    for skip, read in parts(np.random.default_rng(sram)):
        rig.perform(acquisition.skip_bytes(skip))
        target = np.zeros(read, np.uint8)
        rig.perform(acquisition.read_bytes(target))
        at += skip + read
        assert np.array_equal(target, picture[at - read : at])
    assert acquisition.image_open
    assert np.array_equal(rig.memories[sram].reshape(-1), picture)


def test_addressing_saves_the_clocks_of_skipped_bytes() -> None:
    times = []
    for mcu_addressing in (False, True):
        rig = Rig(mcu_addressing=mcu_addressing)
        rig.perform(rig.acquisition.open_image(Sram.SRAM1))
        start_us = rig.now_us
        rig.perform(rig.acquisition.skip_bytes(IMAGE_BYTES - 64))
        times.append(rig.now_us - start_us)
    clocked_us, addressed_us = times
    strobe_us = PIC18F45K20.cycles["strobe_byte"] / 5
    assert clocked_us == pytest.approx(IMAGE_BYTES * strobe_us, rel=0.03)
    assert addressed_us < 50


def test_any_other_command_closes_the_open_image(rig: Rig) -> None:
    target = np.zeros(10, np.uint8)
    for other in (
        rig.acquisition.store(Camera.NADIR, Sram.SRAM2),
        rig.acquisition.window(Sram.SRAM1),
        rig.acquisition.scan(Sram.SRAM2, NadirLines(EdgeConfig(), rig.meter)),
    ):
        rig.perform(rig.acquisition.open_image(Sram.SRAM1))
        rig.perform(rig.acquisition.read_bytes(target))
        assert rig.acquisition.image_open
        rig.perform(other)
        assert not rig.acquisition.image_open


def test_latch_up_closes_the_open_image_and_prevents_reopening(rig: Rig) -> None:
    target = np.zeros(5000, np.uint8)
    rig.perform(rig.acquisition.open_image(Sram.SRAM1))
    latch_after(rig, Sram.SRAM1, 1000)
    rig.perform(rig.acquisition.read_bytes(target))
    assert not rig.acquisition.image_open
    assert not target[1000 + SAMPLE_BYTES + CHUNK :].any()
    assert rig.perform(rig.acquisition.open_image(Sram.SRAM1)) is False


def test_acquisition_reads_single_pixels_by_address() -> None:
    rig = Rig(mcu_addressing=True)
    rig.memories[Sram.SRAM2] = picture = earth(-12, 4)
    meter = rig.meter
    search = around_samples(EdgeConfig(), meter)
    edges, pixels = rig.perform(rig.acquisition.answer(Sram.SRAM2, search))
    assert {*map(tuple, edges.points)} == {*map(tuple, edges_in(picture, meter).points)}
    assert pixels < 250
    latch_after(rig, Sram.SRAM2, 10)
    search = around_samples(EdgeConfig(), meter)
    assert rig.perform(rig.acquisition.answer(Sram.SRAM2, search)) is None


def test_only_own_memories_can_be_addressed_with_the_option() -> None:
    own = {(Camera.SUN, Sram.SRAM1), (Camera.NADIR, Sram.SRAM2)}
    for mcu_addressing, expected in ((False, set()), (True, own)):
        can_address = Rig(mcu_addressing=mcu_addressing).acquisition.can_address
        assert {pair for pair in product(Camera, Sram) if can_address(*pair)} == expected


def test_addressed_pixel_read_costs_the_tabulated_cycles() -> None:
    rig = Rig(mcu_addressing=True)
    asked: NDArray[np.int64] = np.array([[0, 0], [639, 479], [63, 15]])

    def search() -> Iterator[tuple[int, int]]:
        for x, y in asked:
            value = yield int(x), int(y)
            assert value == rig.memories[Sram.SRAM1][y, x]

    rig.perform(rig.acquisition.answer(Sram.SRAM1, search()))
    strobed = [us for us, r in rig.log if isinstance(r, StrobeRead)]
    cycles = rig.meter.table.cycles
    cost = cycles["address_byte"] + 13 * cycles["port_write"] + cycles["strobe_byte"]
    assert np.diff(strobed) == pytest.approx(cost / 5, abs=1)
