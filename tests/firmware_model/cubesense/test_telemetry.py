from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.state import CameraResult
from cubestack.firmware_model.cubesense.telemetry import NODE_TYPE
from cubestack.firmware_model.cubesense.vision.masks import Mask
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.codec.switch_messages import shown_values
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, telemetry
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.firmware_model.node.state import FIRMWARE_VERSION

from .links_harness import Links

Values = dict[str, Any]

UPTIME_US = 70_123_456
OVER = 0x10000
FLAGS = ("TcmdBufferOverrun", "I2cTlmReadError", "UartProtocolError", "UartMsgIncomplete")
SWITCHES = CubeSenseSwitches.of("extended", "edges=listing")


def no_two_alike(node: Links) -> None:
    """Give everything that telemetry shows a value of its own."""
    node.now_us = UPTIME_US
    state = node.state
    for camera, settings in state.cameras.items():
        base = 100 * (camera + 1)
        settings.threshold = base + 1
        settings.auto_adjust = 1 - camera
        settings.exposure = 1000 + base
        settings.gain, settings.blue_gain, settings.red_gain = 2 * base // 5, base + 2, base + 3
        settings.masks = [Mask(*range(base + area, base + area + 40, 10)) for area in range(5)]
        state.results[camera] = CameraResult(
            capture=codes.CaptureResult.STORED_OTHER_SRAM,
            detect=codes.DetectResult(codes.DetectResult.BAD_FIT + camera),
            alpha=1000 + base,
            beta=-2000 - base,
            x=3000 + base,
            y=-4000 - base,
            radius=40000 + base,
            points=base % 250,
            edges=np.arange(2 * 25, dtype=np.int16).reshape(25, 2) * 32 + base,
            sram=codes.Sram(1 - camera),
            first=(base + 4, base + 5),
            sigma=(base + 6, base + 7),
            rms=base + 8,
            found=(base + 9) % 250,
            reason=codes.Reason(camera + 1),
            pixels_read=OVER + base,
            wait_us=OVER + base + 1,
            store_us=OVER + base + 2,
            search_us=OVER + base + 3,
            centroid_us=OVER + base + 4,
            total_us=OVER + base + 5,
        )
    state.over_current = {codes.Sram.SRAM1: False, codes.Sram.SRAM2: True}
    state.switches.now = SWITCHES
    state.nadir_search = codes.NadirSearch.AROUND_SAMPLES
    state.telecommands, state.telemetries = 258, 514
    state.last_command, state.last_processed, state.last_error = 65, 0, AckError.BAD_PARAMETER
    download = node.commands.download
    download.data[:] = np.arange(128) * 3
    download.number, download.checksum = 4097, 171


def of_camera(camera: codes.Camera) -> dict[str, Values]:
    """What a camera's frames show, by the beginnings of their names."""
    base = 100 * (camera + 1)
    phases = ("Wait", "Store", "Search", "Centroid", "Total")
    return {
        "Masks": {
            f"{side}{area + 1}": base + area + 10 * index
            for area in range(5)
            for index, side in enumerate(("XMin", "XMax", "YMin", "YMax"))
        },
        "Details": {
            "X": (3000 + base) / 100,
            "Y": (-4000 - base) / 100,
            "Radius": (40000 + base) / 100,
            "Points": base % 250,
            "Sram": 1 - camera,
            "FirstX": base + 4,
            "FirstY": base + 5,
            "PixelsRead": OVER + base,
        },
        "Quality": {
            "SigmaAlpha": (base + 6) / 100,
            "SigmaBeta": (base + 7) / 100,
            "Rms": (base + 8) / 100,
            "Found": (base + 9) % 250,
            "Reason": camera + 1,
        },
        "PhaseTimes": {phase: OVER + base + 1 + index for index, phase in enumerate(phases)},
    }


def result(camera: codes.Camera) -> Values:
    base = 100 * (camera + 1)
    angles = {"Alpha": (1000 + base) / 100, "Beta": (-2000 - base) / 100}
    return {**angles, "Capture": 3, "Detect": 5 + camera}


def edges(part: int) -> Values:
    """25 edges: 20 in one frame, 5 in the next."""
    values: Values = {"Count": 25}
    for index in range(20 * part, 20 * part + 20):
        there = index < 25
        values[f"X{index + 1}"] = 2 * index + 200 / 32 if there else 0
        values[f"Y{index + 1}"] = 2 * index + 1 + 200 / 32 if there else 0
    return values


def configuration(number: int) -> Values:
    base = 100 * number
    values = {"Threshold": base + 1, "AutoAdjust": 2 - number, "Exposure": 1000 + base}
    values |= {"Gain": 40 * number, "BlueGain": base + 2, "RedGain": base + 3}
    return {f"{name}{number}": value for name, value in values.items()}


EXPECTED: dict[str, Values] = {
    "Identification": {
        "NodeType": NODE_TYPE,
        "InterfaceVersion": 2,
        "FirmwareVersionMajor": FIRMWARE_VERSION[0],
        "FirmwareVersionMinor": FIRMWARE_VERSION[1],
        "RuntimeSeconds": 70,
        "RuntimeMilliseconds": 123,
    },
    "SerialNumber": {"SerialNumber": b"CS0042"},
    "CommunicationStatus": {
        "TcmdCount": 258,
        "TlmCount": 515,  # this request too
        **dict.fromkeys(FLAGS, 0),
    },
    "TcmdProcessed": {"LastTcmd": 65, "Processed": 0, "Error": 3},
    "Power": {
        **{"Current3V3": 1.5, "CurrentSram1": 2.5, "CurrentSram2": 3.5, "Current5V": 4.5},
        **{"OverCurrent1": 0, "OverCurrent2": 1},
    },
    "Configuration": configuration(1) | configuration(2),
    "ImageFrame": {"Frame": (np.arange(128) * 3).astype(np.uint8).tobytes()},
    "ImageFrameInfo": {"FrameNumber": 4097, "Checksum": 171},
    "Profile": shown_values(SWITCHES),
    "NadirSearchMode": {"Search": codes.NadirSearch.AROUND_SAMPLES},
    "NadirEdges1": edges(0),
    "NadirEdges2": edges(1),
    **{f"{kind}{c + 1}": shown for c in codes.Camera for kind, shown in of_camera(c).items()},
    **{INTERFACE.telemetry(number).name: result(c) for c, number in telemetry.RESULTS.items()},
    **{INTERFACE.telemetry(n).name: result(c) for n, (c, _) in telemetry.SCHEDULES.items()},
}


@pytest.mark.parametrize("name", [message.name for message in INTERFACE.telemetries])
def test_every_field_shows_its_source(node: Links, name: str) -> None:
    no_two_alike(node)
    expected = EXPECTED[name]
    assert node.telemetry(name) == pytest.approx(expected)
    assert expected.keys() == {field.name for field in INTERFACE.telemetry(name).fields}


def test_every_telemetry_frame_has_an_expected_value() -> None:
    assert EXPECTED.keys() == {message.name for message in INTERFACE.telemetries}


@pytest.mark.parametrize("flag", FLAGS)
def test_communication_status_shows_each_flag_separately(node: Links, flag: str) -> None:
    node.state.flags.add(flag)
    values = node.telemetry("CommunicationStatus")
    assert {name for name, value in values.items() if value and "Count" not in name} == {flag}


def test_telemetry_after_start_up_has_its_initial_values(node: Links) -> None:
    assert [len(result.edges) for result in node.state.results.values()] == [0, 0]
    for number in (1, 2):
        values = node.telemetry(f"Result{number}")
        assert values == {"Alpha": 0, "Beta": 0, "Capture": 0, "Detect": 0}
        assert set(node.telemetry(f"Masks{number}").values()) == {0}
    assert node.telemetry("ImageFrameInfo") == {"FrameNumber": codes.EMPTY_FRAME, "Checksum": 0}
    assert node.telemetry("TcmdProcessed") == {"LastTcmd": 0, "Processed": 1, "Error": 0}


def test_uptime_wraps_at_16_bits_of_seconds(node: Links) -> None:
    node.now_us = (0x10000 + 5) * 1_000_000 + 999_999
    values = node.telemetry("Identification")
    assert (values["RuntimeSeconds"], values["RuntimeMilliseconds"]) == (5, 999)


@pytest.mark.parametrize(
    ("text", "sent"), [("", bytes(6)), ("A1", b"A1\0\0\0\0"), ("12345678", b"123456"), ("é", b"?")]
)
def test_serial_numbers_are_six_bytes_of_ascii(node: Links, text: str, sent: bytes) -> None:
    node.serial_number = text
    assert node.telemetry("SerialNumber")["SerialNumber"] == sent.ljust(6, b"\0")
