import json
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.contract import PinEvent
from tests.emulator.rtl.cameras import plain_camera
from tests.emulator.rtl.capture.recorded import Waves, waves, write_vcd
from tests.emulator.rtl.commanded import camera_events

from ....conftest import Run


@pytest.fixture(scope="module")
def recorded() -> Waves:
    """Three rows of a frame, at full size."""
    wiring = cubestar_wiring()
    events = [*camera_events(wiring.cameras[0], plain_camera(1024, 3, 1))]
    events += [PinEvent(1_050_001, "ENABLE", 1), PinEvent(320_000_001, "ENABLE", 0)]
    return waves(wiring, sorted(events))


def test_equal_capture_prints_pins_and_timing(recorded: Waves, run: Run, tmp_path: Path) -> None:
    path = write_vcd(tmp_path / "capture.vcd", recorded)
    outcome = run("hdl", "compare", path, "--device", "cubestar", "--out", tmp_path / "out")
    assert outcome.code == 0
    assert "equal within 20 ns" in outcome.out
    timing = next(line for line in outcome.out.splitlines() if "SRAM_WE_N pulse" in line)
    assert timing.split() == ["SRAM_WE_N", "pulse", "3072", "50", "50", "50", "50", ">=", "8"]
    assert (tmp_path / "out/compare.vcd").is_file()


def test_first_difference_is_shown_with_the_changes_before(
    recorded: Waves, run: Run, tmp_path: Path
) -> None:
    levels = {**recorded.levels, "SRAM_A": recorded.levels["SRAM_A"].copy()}
    write = recorded.levels["SRAM_WE_N"]
    place = np.flatnonzero(np.diff(write) == -1)[0x60] + 1
    levels["SRAM_A"][place : place + np.argmax(write[place:] == 1)] ^= 4
    planted = Waves(recorded.wiring, recorded.times, levels, recorded.widths)
    path = write_vcd(tmp_path / "capture.vcd", planted)
    call = "hdl", "compare", path, "--device", "cubestar"
    outcome = run(*call)
    at = f"{recorded.times[place] / 1000:g} ns"
    assert outcome.code == 1
    assert f"first difference: SRAM_A at {at}: captured 64, emulated 60" in outcome.out
    table = outcome.out.partition("Changes before")[2]
    assert sorted({line.split()[-1] for line in table.splitlines()[2:10]}) == [
        "captured",
        "emulated",
    ]
    (found,) = json.loads(run(*call, "--json").out)["differences"]
    assert (found["pin"], found["captured"], found["emulated"]) == ("SRAM_A", 0x64, 0x60)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--map", "PIXCLK"], "'PIXCLK' is no NAME=VALUE"),
        (["--hold", "BANK=x"], "--hold needs PIN=LEVEL with a hexadecimal level: --hold BANK=0"),
        (["--hold", "BANK=2"], "BANK has 1 bits, too few for 2"),
        (["--hold", "ACK=1"], "ACK is no input; the inputs are PIXCLK"),
        (["--map", "ACK=FOO"], "channel libsigrok.ACK (mapped to FOO) is no pin; the pins are"),
        (["--skew", "-1"], "must be 0 to 1000000000, not -1.0"),
    ],
)
def test_wrong_call_is_one_line(
    options: list[str], text: str, recorded: Waves, run: Run, tmp_path: Path
) -> None:
    path = write_vcd(tmp_path / "capture.vcd", recorded.cut(len(recorded.times) - 50))
    outcome = run("hdl", "compare", path, "--device", "cubestar", *options)
    assert outcome.code == 2
    assert text in outcome.err
    assert outcome.err.count("\n") == 1


def test_missing_or_damaged_file_is_one_line(run: Run, tmp_path: Path) -> None:
    (tmp_path / "damaged.vcd").write_text("$date")
    for name, status in (("none.vcd", 1), ("damaged.vcd", 2)):
        outcome = run("hdl", "compare", tmp_path / name, "--device", "cubestar")
        assert (outcome.code, outcome.err.count("\n")) == (status, 1)
        assert name in outcome.err
