"""CubeStar's program in C on its processor's simulator, over the wire.

Telemetry of pictures is compared bit by bit with the model's.
"""

import sys
from collections.abc import Iterator

import numpy as np
import pytest

import cubestack
from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import MemoryTest, ResetCause
from cubestack.host.clients.node import NodeClient
from cubestack.host.conformance.contract import CheckRun, Verdict
from cubestack.host.conformance.suite import check_reads
from cubestack.host.conformance.writes import check_writes
from cubestack.host.devices.registry import device
from cubestack.host.emulation.controls import EmulatedControls
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.errors import CommandRefusedError
from cubestack.host.experiments.attitude import errors
from cubestack.host.targets import Target
from tests.system.conftest import ROOT

from .reference_pictures import compare

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

START_S = 0.02
"""From power-up until the program hears."""


@pytest.fixture
def star() -> Iterator[AnyEmulated]:
    with open_device("cubestar", firmware="reference", seed=5) as opened:
        opened.wait(START_S)
        yield opened


@pytest.fixture
def node(star: AnyEmulated) -> NodeClient:
    client = star.client.client
    assert isinstance(client, NodeClient)
    return client


def raised(node: NodeClient) -> set[str]:
    return {name for name, value in node.telemetry("ErrorFlags").items() if value}


def perform(node: NodeClient, name: str, timeout_s: float = 3.0, **parameters: object) -> None:
    node.command(name, **parameters)
    node.wait_processed(timeout_s)


def uptime_s(node: NodeClient) -> float:
    answer = node.telemetry("Identification")
    return float(answer["RuntimeSeconds"]) + float(answer["RuntimeMilliseconds"]) / 1000


def test_loop_tracks_and_keeps_time_across_resets(star: AnyEmulated, node: NodeClient) -> None:
    node.command("Trigger")
    node.pause(4.85)
    loop, identification = node.telemetry("LoopStatus"), node.telemetry("ExtendedIdentification")
    assert (loop["Iterations"], loop["ModeFlag"], loop["Running"]) == (5, 0, True)
    assert identification["ResetCause"] == ResetCause.SYSTEM_REQUEST
    assert identification["WDGResetCount"] == 0
    assert raised(node) <= {"MaxStarsDetection"}
    latest = node.telemetry("AttitudeQuaternion")
    assert latest["Valid"]
    assert latest["FrameCounter"] == 4
    quaternion = np.array([latest[f"Q{index}"] for index in range(4)])
    cross_deg, roll_deg = errors(quaternion, star.board.truth())
    assert cross_deg < 0.005
    assert abs(roll_deg) < 0.02
    times = node.telemetry("PhaseTimes")
    assert 380_000 < times["Capture"] < 390_000  # the FPGA's
    assert times["LoopTotal"] < 700_000
    asked_s = star.time_s
    assert uptime_s(node) == pytest.approx(asked_s, abs=0.005)


def test_settings_survive_a_reset_and_power_up_values_return(node: NodeClient) -> None:
    perform(node, "setStarPixels", MinPixels=9, MaxPixels=77)
    perform(node, "SaveConfig")
    perform(node, "setStarPixels", MinPixels=10, MaxPixels=78)
    node.command("MCUReset")
    node.pause(START_S)
    assert node.telemetry("StarPixels") == {"MinPixels": 10, "MaxPixels": 78}
    node.command("Reset")
    node.pause(START_S)
    assert node.telemetry("StarPixels") == {"MinPixels": 9, "MaxPixels": 77}
    perform(node, "ClearConfig")
    assert node.telemetry("StarPixels") == {"MinPixels": 6, "MaxPixels": 60}
    assert node.telemetry("ExtendedIdentification")["TcmdCount"] == 1


def test_watchdog_ends_a_hang(node: NodeClient) -> None:
    node.command("TestWDG")
    node.pause(1.9)
    assert node.telemetry("TcmdProcessed")["Processed"] == 0  # interrupts are served
    node.pause(0.3)
    identification = node.telemetry("ExtendedIdentification")
    assert identification["ResetCause"] == ResetCause.WATCHDOG
    assert identification["WDGResetCount"] == 1


@pytest.mark.parametrize("channel", ["memory", "imager"])
def test_a_latch_up_is_cut_off_and_healed(
    star: AnyEmulated, node: NodeClient, channel: str
) -> None:
    star.board.power.latch_up(channel)
    node.pause(1e-4)
    assert star.board.power.current_ma(channel) == 0
    node.pause(0.2)
    assert star.board.power.current_ma(channel) > 0
    supply = node.telemetry("SupplyReport")
    assert (supply["LatchUps"], supply["PowerCycles"]) == (1, 1)
    assert supply["SramCurrent"] == pytest.approx(2.0, abs=0.1)
    assert supply["ImagerCurrent"] == pytest.approx(52.8, abs=0.3)
    assert raised(node) == {"OverCurrent"}


def test_reference_firmware_rejects_other_profiles(node: NodeClient) -> None:
    shown = node.telemetry("Profile")
    perform(node, "SetProfile", Profile="PUBLISHED")
    with pytest.raises(CommandRefusedError):
        node.command("SetProfile", Profile="EXTENDED")
    with pytest.raises(CommandRefusedError):
        node.command("SetSwitch", Switch="VOTING", Value="CONFIRMED")
    assert node.telemetry("Profile") == shown


def test_image_upload_and_download(node: NodeClient) -> None:
    perform(node, "UploadImage")
    data = bytes(range(128))
    perform(node, "UploadBlock", BlockNumber=4000, Data=data)
    perform(node, "ImageBlockSet", BlockNumber=4000, BlockSize="BYTES_128")
    assert node.telemetry("ImageBlock")["Block"] == data
    assert node.telemetry("UploadStatus") == {"NextBlock": 4001, "BlocksReceived": 1}
    perform(node, "ImageBlockSet", BlockNumber=2000, BlockSize="BYTES_256")
    halves = [node.telemetry("ImageBlock")["Block"] for _ in range(3)]
    assert halves == [data, bytes(128), data]
    perform(node, "TestSRAM")
    assert node.telemetry("SRAMTestResults")["TestResult"] == MemoryTest.PASSED


@pytest.mark.parametrize(
    ("wire", "answer", "flags"),
    [
        (encode_frame(b"\x80")[:3], b"", {"UART_MsgIncomplete", "UART_RXTimeout"}),
        (encode_frame(bytes([8]) + bytes(200)), b"\x02", {"UART_Tcmd_TooManyParm"}),
        (encode_frame(b"\x08"), b"\x02", {"UART_Tcmd_TooFewParm"}),
        (encode_frame(b"\x77"), b"\x01", {"TcmdIDError"}),
        (encode_frame(b"\x8a"), b"", {"TlmIDError"}),
        (b"\x55", b"", {"UART_ProtocolError"}),
    ],
)
def test_invalid_messages_are_answered_and_flagged(
    star: AnyEmulated, wire: bytes, answer: bytes, flags: set[str]
) -> None:
    port = star.serial(timeout=0.2)
    port.write(wire)
    assert port.read(16) == (encode_frame(answer) if answer else b"")
    client = star.client.client
    assert isinstance(client, NodeClient)
    assert raised(client) == flags


def test_reference_firmware_answers_over_i2c(star: AnyEmulated, node: NodeClient) -> None:
    bus = star.smbus()
    address = INTERFACE.i2c_address
    assert bus.read_i2c_block_data(address, 128, 4) == [5, 3, 0, 1]
    bus.write_i2c_block_data(address, 22, [9, 77])  # setStarPixels
    assert bus.read_i2c_block_data(address, 147, 2) == [9, 77]
    assert bus.read_byte(address) == 0xFF  # no ID was written before it
    assert bus.read_i2c_block_data(address, 138, 1) == [0xFF]  # none that there is
    bus.write_i2c_block_data(address, 22, [9, 77, 1])
    wanted = {"I2C_WaitForIDReadRequestError", "TlmIDError", "I2C_TCMD_TooManyparm"}
    assert raised(node) == wanted


def test_reference_firmware_passes_the_conformance_checks(
    star: AnyEmulated, node: NodeClient
) -> None:
    notes = device("cubestar").conformance
    target = Target("emulated", INTERFACE, node, controls=EmulatedControls(star))
    run = CheckRun(target, notes=notes)
    check_reads(run)
    check_writes(run)
    assert {check.name for check in run.checks if check.verdict is Verdict.FAILED} == set()
    assert sum(check.verdict is Verdict.PASSED for check in run.checks) > 60


@pytest.mark.parametrize("program", ["plain_pyserial.py"])
def test_example_programs_run_on_the_reference_firmware(star: AnyEmulated, program: str) -> None:
    done = star.run(sys.executable, ROOT / "examples" / program, "{port}")
    assert (done.returncode, done.stderr) == (0, "")


def test_reference_firmware_telemetry_matches_in_every_mode() -> None:
    found = list(compare(3, 16, "reference"))
    assert [one.differences for one in found] == [[]] * 3
    assert {one.mode for one in found} == {"lost", "assisted", "as it stands"}
    assert any(one.solved for one in found)
    assert all(one.stars > 3 for one in found)


def test_reference_firmware_measures_the_same_quaternions() -> None:
    options = {"frames": 3, "seed": 7, "no_noise": True, "threshold": 16}
    both = [
        [
            (one.centroids, one.matched, one.quaternion)
            for one in cubestack.measure("cubestar", **options, **board)
        ]
        for board in ({}, {"firmware": "reference"})
    ]
    assert both[0] == both[1]
    assert any(quaternion is not None for _, _, quaternion in both[0])
