"""VCD files of whole boards, read by others: lines, FPGA pins and firmware on one time axis.

The files are those of ``--trace``, made from recordings by a replay as well.
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.cli.device_options import record
from cubestack.host.cli.main import main
from cubestack.host.clients.contract import Client
from cubestack.host.emulation.emulated import open_device
from cubestack.host.output import Outputs
from cubestack.host.recording.setups import emulated_setup
from tests.emulator.recording import vcd

PS_PER_NS = 1000


def read(path: Path) -> vcd.Changes:
    with path.open("rb") as stream:
        return vcd.read(stream)


@contextmanager
def traced(device: str, folder: Path) -> Iterator[Client]:
    """The client of a device that is traced and recorded in ``folder``."""
    args = argparse.Namespace(record=folder / "run.rec", trace=folder / "run.vcd")
    with open_device(device, seed=2) as opened, Outputs() as stack:
        record(args, opened, stack, emulated_setup(2, None))
        yield opened.client.client


#: A command; what becomes what after it; and how long the second of these takes at least and most.
STORIES: dict[str, tuple[str, list[tuple[str, object]], tuple[float, float]]] = {
    "cubestar": (
        "CaptureImage",
        [("fpga.ENABLE", 1), ("fpga.ACK", 1), ("firmware.task", "CAPTURED")],
        (0.1, 0.9),  # a frame, or nearly two
    ),
    "cubesense": (
        "CaptureAndDetect",
        [("fpga.SUNEN", 0), ("fpga.SUNACK", 1), ("firmware.sun_detect", "SUCCESS")],
        (0.03, 0.07),
    ),
    "aramis": ("Activate", [("firmware.task", "ACTIVATING"), ("firmware.task", "READY")], (0, 1)),
}


@pytest.mark.parametrize("device", STORIES)
def test_command_is_traced_from_line_to_pins(device: str, tmp_path: Path) -> None:
    command, story, (least_s, most_s) = STORIES[device]
    with traced(device, tmp_path) as client:
        client.pause(0.5)
        message = client.interface.telecommand(command)
        client.command(command, **dict.fromkeys((field.name for field in message.fields), 0))
        client.pause(2.0)
    changes = read(tmp_path / "run.vcd")
    data, times = load_recording(tmp_path / "run.rec").sent("uart", "host")
    at = [times[data.index(bytes([0x1F, 0x7F, message.id]))] // PS_PER_NS]
    assert (at[0], 0x1F) in changes["uart.rx_byte"]
    assert "firmware.awake" in changes
    for name, value in story:
        after = [time_ns for time_ns, found in changes[name] if time_ns > at[-1] and found == value]
        assert after, f"{name} never becomes {value} after {at[-1]} ns: {changes[name][-5:]}"
        at.append(after[0])
    assert least_s < (at[2] - at[1]) / 1e9 < most_s
    told = changes[story[-1][0]]
    assert any(at[0] < time_ns <= at[1] for time_ns, _ in told)  # that it is busy


def test_replay_makes_the_same_trace(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with traced("cubesense", tmp_path) as client:
        client.command("CaptureOnly", Camera=1, Sram=1, Location=0)
        client.pause(0.3)
    again = tmp_path / "again.vcd"
    assert main(["replay", str(tmp_path / "run.rec"), "--trace", str(again)]) == 0
    assert "no difference" in capsys.readouterr().out
    first, second = read(tmp_path / "run.vcd"), read(again)
    assert "fpga.SUN_SRAM_A" in first
    end_ns = max(time_ns for changes in first.values() for time_ns, _ in changes)
    assert first.keys() == second.keys()
    for name, changes in first.items():
        assert [change for change in second[name] if change[0] <= end_ns] == changes, name
