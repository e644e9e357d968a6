"""VCD files of whole boards, read by others: lines, FPGA pins and firmware on one time axis.

The files are those of ``--trace``, made from recordings by a replay as well.
"""

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.cubestar.codes import TaskStatus
from cubestack.host.cli.device_options import record
from cubestack.host.cli.main import main
from cubestack.host.clients.contract import Client
from cubestack.host.devices.emulated import open_device
from cubestack.host.devices.registry import device as registered
from cubestack.host.recording.setups import emulated_setup
from tests.emulator.recording import vcd
from tests.emulator.recording.vcd import Changes

PS_PER_NS = 1000


def read(path: Path) -> Changes:
    with path.open("rb") as stream:
        return vcd.read(stream)


def when(changes: Changes, name: str, value: object, after_ns: int = 0) -> int:
    """First time from ``after_ns`` on at which a variable becomes ``value``."""
    times = [time_ns for time_ns, found in changes[name] if time_ns >= after_ns and found == value]
    assert times, f"{name} never becomes {value} after {after_ns} ns: {changes[name][-5:]}"
    return times[0]


@contextmanager
def traced(device: str, folder: Path) -> Iterator[tuple[Any, Client]]:
    """A device whose run is traced and recorded in ``folder``, and a client."""
    args = argparse.Namespace(record=folder / "run.rec", trace=folder / "run.vcd")
    with ExitStack() as stack:
        opened = open_device(device, seed=2)
        board: Any = opened.board
        stack.callback(board.close)
        record(args, opened, stack, emulated_setup(2, None))
        yield board, opened.client.client


def interface_of(device: str) -> Interface:
    return registered(device).interface


def first_byte_ns(folder: Path, identifier: int) -> int:
    """When the host's first message with that ID begins, by the recording."""
    data, times = load_recording(folder / "run.rec").sent("uart", "host")
    return times[data.index(bytes([0x1F, 0x7F, identifier]))] // PS_PER_NS


def test_a_cubestar_takes_a_picture(tmp_path: Path) -> None:
    """Command on the line, task state, ENABLE, the FPGA's ACK, task state: in this order."""
    with traced("cubestar", tmp_path) as (_, client):
        client.wait_processed(5)
        client.command("CaptureImage")
        client.wait_processed(5)
    changes = read(tmp_path / "run.vcd")
    command = first_byte_ns(tmp_path, interface_of("cubestar").telecommand("CaptureImage").id)
    heard = when(changes, "uart.rx_byte", 0x1F, command)
    assert heard == command
    busy = min(t for t, name in changes["firmware.task"] if t > command)
    store = when(changes, "fpga.ENABLE", 1, command)
    stored = when(changes, "fpga.ACK", 1, store)
    done = when(changes, "firmware.task", TaskStatus.CAPTURED.name, stored)
    assert command < busy <= store < stored < done
    assert 100e6 < stored - store < 900e6  # a frame, or nearly two
    assert when(changes, "fpga.SRAM_WE_N", 1, store) < done


def test_a_cubesense_measures_the_sun(tmp_path: Path) -> None:
    with traced("cubesense", tmp_path) as (_, client):
        client.command("CaptureAndDetect", Camera=0, Sram=0)
        client.pause(0.5)
    changes = read(tmp_path / "run.vcd")
    command = first_byte_ns(tmp_path, interface_of("cubesense").telecommand("CaptureAndDetect").id)
    assert {"fpga.SUN_SRAM_A", "uart.rx_byte", "firmware.awake"} <= changes.keys()
    pending = when(changes, "firmware.sun_detect", "PENDING", command)
    store = when(changes, "fpga.SUNEN", 0, pending)  # active low
    stored = when(changes, "fpga.SUNACK", 1, store)
    found = when(changes, "firmware.sun_detect", "SUCCESS", stored)
    assert command < pending <= store < stored < found


def test_an_aramis_measures(tmp_path: Path) -> None:
    """No FPGA: task state and lines."""
    with traced("aramis", tmp_path) as (_, client):
        client.command("Activate")
        client.wait_processed(10)
    changes = read(tmp_path / "run.vcd")
    command = first_byte_ns(tmp_path, interface_of("aramis").telecommand("Activate").id)
    activating = when(changes, "firmware.task", "ACTIVATING", command)
    assert command < activating < when(changes, "firmware.task", "READY", activating)


def test_a_recording_becomes_the_trace_of_its_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with traced("cubesense", tmp_path) as (_, client):
        client.command("CaptureOnly", Camera=1, Sram=1, Location=0)
        client.pause(0.3)
    again = tmp_path / "again.vcd"
    assert main(["replay", str(tmp_path / "run.rec"), "--trace", str(again)]) == 0
    assert "no difference" in capsys.readouterr().out
    first, second = read(tmp_path / "run.vcd"), read(again)
    end_ns = max(time_ns for changes in first.values() for time_ns, _ in changes)
    assert first.keys() == second.keys()
    for name, changes in first.items():
        assert [change for change in second[name] if change[0] <= end_ns] == changes, name
