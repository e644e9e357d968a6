from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.capture.board import ComparedCapture, compare_capture
from cubestack.emulator.rtl.capture.capture import CaptureError
from cubestack.emulator.rtl.capture.read import read_capture
from cubestack.emulator.rtl.capture.write_vcd import write_vcd as write_both
from cubestack.emulator.rtl.contract import PinEvent
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.host.cli.hdl.waveform import read as read_wave
from tests.hdl.engines.board_events import BOARDS, random_events
from tests.tiers import quick_ones

from ..cameras import plain_camera
from ..commanded import camera_events
from .recorded import Waves, waves, write_csv, write_vcd

BOARD = cubestar_wiring(CubeStarTop(8, 4))
READS_PS = 13_500_000
PERIOD_PS = 770_833


def _events() -> list[PinEvent]:
    """A frame is stored, then read."""
    events = [*camera_events(BOARD.cameras[0], plain_camera(8, 4, 3))]
    events += [PinEvent(1_050_001, "ENABLE", 1), PinEvent(12_000_003, "ENABLE", 0)]
    events += [PinEvent(13_000_001, "RNW", 1), PinEvent(13_200_001, "ENABLE", 1)]
    for half in range(64):
        events.append(PinEvent(READS_PS + half * PERIOD_PS // 2, "DCLK", 1 - half % 2))
    events += [PinEvent(40_000_001, "ENABLE", 0), PinEvent(40_500_001, "RNW", 0)]
    return sorted(events)


@pytest.fixture(scope="module")
def recorded() -> Waves:
    return waves(BOARD, _events())


def compared(path: Path, wiring: Wiring = BOARD, **options: Any) -> ComparedCapture:
    return compare_capture(read_capture(path), wiring, lambda: make_engine(wiring), **options)


@pytest.mark.parametrize("name", quick_ones(BOARDS, "cubestar"))
def test_capture_of_the_emulated_board_is_equal(name: str, tmp_path: Path) -> None:
    board = BOARDS[name]
    wiring = board.wiring(False)
    events = random_events(board, wiring, np.random.default_rng(3), 200_000_000)
    path = write_vcd(tmp_path / "capture.vcd", waves(wiring, events, bytes(range(1, 250))))
    found = compared(path, wiring, skew_ps=0)
    assert not found.comparison.differences
    assert all(found.comparison.bits[pin] for pin in found.outputs if pin != wiring.contention)


def test_late_channels_are_equal_within_the_skew(recorded: Waves, tmp_path: Path) -> None:
    path = write_vcd(tmp_path / "late.vcd", recorded, jitter=lambda name: len(name) * 1_900 % 9_000)
    assert not compared(path).comparison.differences
    assert compared(path, skew_ps=1_000).comparison.differences


@pytest.mark.parametrize("period_ps", [20_000, 41_667])
def test_sampled_csv_is_equal(recorded: Waves, period_ps: int, tmp_path: Path) -> None:
    found = compared(write_csv(tmp_path / "capture.csv", recorded, period_ps))
    assert not found.comparison.differences
    assert found.skew_ps == pytest.approx(2 * period_ps, abs=1)
    few = any("samples per period of PIXCLK" in note for note in found.notes)
    assert few == (period_ps > 25_000)


def _once(at: int, bit: int) -> Callable[[NDArray[np.int64]], NDArray[np.int64]]:
    return lambda levels: np.where(np.arange(len(levels)) == at, levels ^ bit, levels)


def _no_ack(levels: NDArray[np.int64]) -> NDArray[np.int64]:
    return levels * 0


@pytest.mark.parametrize(
    ("pin", "change", "count"),
    [
        ("ACK", _no_ack, 1),
        ("SRAM_A", _once(140, 2), 1),
        ("DATA", _once(-20 % 738, 1), 1),
        ("SRAM_WE_N", lambda levels: np.where(np.arange(len(levels)) < 170, levels, 1), 8),
    ],
)
def test_planted_difference_is_found(
    pin: str,
    change: Callable[[NDArray[np.int64]], Any],
    count: int,
    recorded: Waves,
    tmp_path: Path,
) -> None:
    levels = {**recorded.levels, pin: change(recorded.levels[pin])}
    planted = Waves(recorded.wiring, recorded.times, levels, recorded.widths)
    found = compared(write_vcd(tmp_path / "planted.vcd", planted)).comparison
    first = np.flatnonzero(levels[pin] != recorded.levels[pin])[0]
    assert found.counts == {**dict.fromkeys(found.bits, 0), pin: count}
    assert found.differences[0].time_ps == recorded.times[first]
    assert found.differences[0].captured == levels[pin][first]
    assert found.differences[0].emulated == recorded.levels[pin][first]


def test_wrong_byte_on_the_data_bus_is_found_while_the_fpga_drives_it(
    recorded: Waves, tmp_path: Path
) -> None:
    """Between two pulses the bus floats, and its level is not compared."""
    written = recorded.levels["SRAM_WE_N"] == 0
    levels = np.where(written, recorded.levels["SRAM_D"] ^ 4, recorded.levels["SRAM_D"])
    planted = Waves(
        recorded.wiring, recorded.times, {**recorded.levels, "SRAM_D": levels}, recorded.widths
    )
    found = compared(write_vcd(tmp_path / "planted.vcd", planted)).comparison
    assert found.counts["SRAM_D"] == 32  # a pixel each


@pytest.mark.parametrize("begin_ps", [4_000_000, 9_000_000])
def test_capture_that_begins_in_a_frame_is_compared_from_the_next_known_state(
    begin_ps: int, recorded: Waves, tmp_path: Path
) -> None:
    first = int(np.searchsorted(recorded.times, begin_ps))
    found = compared(write_vcd(tmp_path / "late.vcd", recorded.cut(first)))
    assert not found.comparison.differences
    assert found.emulated.since_ps > begin_ps
    assert "the FPGA's state is not known" in found.notes[0]
    assert found.comparison.bits["DATA"] == 0xFF  # learned from the bus


def test_capture_that_never_shows_a_known_state_is_rejected(
    recorded: Waves, tmp_path: Path
) -> None:
    first = int(np.searchsorted(recorded.times, 20_000_000))
    path = write_vcd(tmp_path / "read.vcd", recorded.cut(first), without=["PIXCLK"])
    with pytest.raises(CaptureError, match="begin it while the FPGA is idle, or use --from-power"):
        compared(path)
    assert compared(path, powered_up=True).comparison.differences


def test_outputs_that_depend_on_a_missing_input_are_not_compared(
    recorded: Waves, tmp_path: Path
) -> None:
    path = write_vcd(tmp_path / "few.vcd", recorded, without=["BANK", "PIXDATA"])
    found = compared(path)
    assert not found.comparison.differences
    notes = "\n".join(found.notes)
    assert "BANK was not captured; held at 0; SRAM_A[5] not compared" in notes
    assert "PIXDATA was not captured; held at 0; DATA, SRAM_D not compared" in notes
    assert found.comparison.bits["SRAM_A"] == 0b011111
    tied = compared(path, held={"bank": 0})
    assert tied.comparison.bits["SRAM_A"] == 0b111111
    assert compared(path, held={"BANK": 1}).comparison.counts["SRAM_A"] > 0


@pytest.mark.parametrize(
    ("without", "text"),
    [
        (["PIXCLK"], "PIXCLK was not captured, but an image is stored from 1050.001 ns on"),
        (["DCLK"], "DCLK was not captured, and DATA needs it; --hold DCLK=0"),
        (
            ["ACK", "DATA", *(pin for pin in BOARD.output_pins)],
            "no output of the FPGA was captured",
        ),
        (["PIXCLK", "PIXDATA", "HSYNC", "VSYNC", "ENABLE", "RNW", "BANK", "DCLK"], "no input of"),
    ],
)
def test_missing_pins_that_are_needed_are_one_line(
    without: list[str], text: str, recorded: Waves, tmp_path: Path
) -> None:
    path = write_vcd(tmp_path / "few.vcd", recorded, without=[*without, "SRAM_D"])
    with pytest.raises(CaptureError, match=text):
        compared(path)


def test_timing_is_measured_at_the_captured_pins(recorded: Waves, tmp_path: Path) -> None:
    late = write_vcd(tmp_path / "late.vcd", recorded, jitter=lambda name: 7_000 * (name == "ACK"))
    times = {name: found for name, (found, _) in compared(late).timing.items() if found}
    least = {name: int(found.found_ps.min()) for name, found in times.items()}
    assert least["PIXCLK period"] == 100_000
    assert least["last pixel of imager to ACK"] == 107_000
    assert least["SRAM_WE_N pulse"] == 50_000
    assert least["SRAM_D before SRAM_WE_N rises"] == 100_000
    assert least["DCLK to DATA"] == 0
    assert times["SRAM_WE_N pulse"].least_ps == 8_000


def test_vcd_of_both_ends_with_the_levels_of_both(recorded: Waves, tmp_path: Path) -> None:
    levels = {**recorded.levels, "ACK": recorded.levels["ACK"] * 0}
    planted = Waves(recorded.wiring, recorded.times, levels, recorded.widths)
    found = compared(write_vcd(tmp_path / "planted.vcd", planted))
    with (tmp_path / "both.vcd").open("w") as stream:
        write_both(found, stream)
    trace = read_wave(tmp_path / "both.vcd", 10_000)
    changes = [(time, changes) for time, changes in trace.moments if "DIFFERS" in changes]
    (difference,) = found.comparison.differences
    assert [(time, change["DIFFERS"]) for time, change in changes] == [
        (0, "0"),
        (difference.time_ps, "1"),
        (difference.end_ps, "0"),
    ]
    assert {"ACK", "EMU_ACK", "ENABLE"} <= {*trace.signals}
    assert changes[1][1]["EMU_ACK"] == "1"
