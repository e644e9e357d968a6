from collections.abc import Callable
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
        settings.masks = [
            Mask(base + area, base + area + 10, base + area + 20, base + area + 30)
            for area in range(5)
        ]
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


def result(camera: codes.Camera) -> Values:
    base = (camera + 1) * 100
    return {
        "Alpha": (1000 + base) / 100,
        "Beta": (-2000 - base) / 100,
        "Capture": 3,
        "Detect": 5 + camera,
    }


def masks(camera: codes.Camera) -> Values:
    base = (camera + 1) * 100
    names = ("XMin", "XMax", "YMin", "YMax")
    return {
        f"{name}{area + 1}": base + area + 10 * index
        for area in range(5)
        for index, name in enumerate(names)
    }


def details(camera: codes.Camera) -> Values:
    base = (camera + 1) * 100
    return {
        "X": (3000 + base) / 100,
        "Y": (-4000 - base) / 100,
        "Radius": (40000 + base) / 100,
        "Points": base % 250,
        "Sram": 1 - camera,
        "FirstX": base + 4,
        "FirstY": base + 5,
        "PixelsRead": OVER + base,
    }


def quality(camera: codes.Camera) -> Values:
    base = (camera + 1) * 100
    return {
        "SigmaAlpha": (base + 6) / 100,
        "SigmaBeta": (base + 7) / 100,
        "Rms": (base + 8) / 100,
        "Found": (base + 9) % 250,
        "Reason": camera + 1,
    }


def times(camera: codes.Camera) -> Values:
    start = OVER + (camera + 1) * 100
    phases = ("Wait", "Store", "Search", "Centroid", "Total")
    return {name: start + 1 + index for index, name in enumerate(phases)}


def edges(part: int) -> Values:
    """25 edges: 20 in one frame, 5 in the next."""
    values: Values = {"Count": 25}
    for index in range(20 * part, 20 * part + 20):
        there = index < 25
        values[f"X{index + 1}"] = 2 * index + 200 / 32 if there else 0
        values[f"Y{index + 1}"] = 2 * index + 1 + 200 / 32 if there else 0
    return values


def configuration() -> Values:
    values: Values = {}
    for number in (1, 2):
        base = 100 * number
        values |= {
            f"Threshold{number}": base + 1,
            f"AutoAdjust{number}": 2 - number,
            f"Exposure{number}": 1000 + base,
            f"Gain{number}": 40 * number,
            f"BlueGain{number}": base + 2,
            f"RedGain{number}": base + 3,
        }
    return values


EXPECTED: dict[str, Callable[[], Values]] = {
    "Identification": lambda: {
        "NodeType": NODE_TYPE,
        "InterfaceVersion": 2,
        "FirmwareVersionMajor": FIRMWARE_VERSION[0],
        "FirmwareVersionMinor": FIRMWARE_VERSION[1],
        "RuntimeSeconds": 70,
        "RuntimeMilliseconds": 123,
    },
    "SerialNumber": lambda: {"SerialNumber": b"CS0042"},
    "CommunicationStatus": lambda: {
        "TcmdCount": 258,
        "TlmCount": 515,  # this request too
        "TcmdBufferOverrun": 0,
        "I2cTlmReadError": 0,
        "UartProtocolError": 0,
        "UartMsgIncomplete": 0,
    },
    "TcmdProcessed": lambda: {"LastTcmd": 65, "Processed": 0, "Error": 3},
    "Power": lambda: {
        "Current3V3": 1.5,
        "CurrentSram1": 2.5,
        "CurrentSram2": 3.5,
        "Current5V": 4.5,
        "OverCurrent1": 0,
        "OverCurrent2": 1,
    },
    "Configuration": configuration,
    "ImageFrame": lambda: {"Frame": (np.arange(128) * 3).astype(np.uint8).tobytes()},
    "ImageFrameInfo": lambda: {"FrameNumber": 4097, "Checksum": 171},
    "Profile": lambda: shown_values(SWITCHES),
    "NadirSearchMode": lambda: {"Search": codes.NadirSearch.AROUND_SAMPLES},
    "NadirEdges1": lambda: edges(0),
    "NadirEdges2": lambda: edges(1),
    **{f"Masks{camera + 1}": lambda c=camera: masks(c) for camera in codes.Camera},
    **{f"Details{camera + 1}": lambda c=camera: details(c) for camera in codes.Camera},
    **{f"Quality{camera + 1}": lambda c=camera: quality(c) for camera in codes.Camera},
    **{f"PhaseTimes{camera + 1}": lambda c=camera: times(c) for camera in codes.Camera},
    **{
        INTERFACE.telemetry(identifier).name: lambda c=camera: result(c)
        for camera, identifier in (
            *telemetry.RESULTS.items(),
            *((target[0], key) for key, target in telemetry.SCHEDULES.items()),
        )
    },
}


@pytest.mark.parametrize("name", [message.name for message in INTERFACE.telemetries])
def test_every_field_shows_its_source(node: Links, name: str) -> None:
    no_two_alike(node)
    expected = EXPECTED[name]()
    assert node.telemetry(name) == pytest.approx(expected)
    assert expected.keys() == {field.name for field in INTERFACE.telemetry(name).fields}


def test_every_frame_is_expected() -> None:
    assert EXPECTED.keys() == {message.name for message in INTERFACE.telemetries}


@pytest.mark.parametrize(
    "flag", ["TcmdBufferOverrun", "I2cTlmReadError", "UartProtocolError", "UartMsgIncomplete"]
)
def test_each_flag_is_shown_alone(node: Links, flag: str) -> None:
    node.state.flags.add(flag)
    values = node.telemetry("CommunicationStatus")
    assert {name for name, value in values.items() if value and "Count" not in name} == {flag}


def test_after_start_up(node: Links) -> None:
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
