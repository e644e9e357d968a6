"""The node protocol: bytes of real hosts, errors, both buses."""

import pytest

from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.links.node import SEND_BYTES
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.node_codes import AckError
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    CaptureResult,
    DetectResult,
    ImageSize,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.telemetry import SCHEDULES
from cubestack.firmware_model.mcu.requests import Request
from cubestack.firmware_model.node.link import longest_command

from .node import Node

OK = bytes.fromhex("1F7F 00 1FFF")


@pytest.fixture
def node() -> Node:
    return Node()


# --- bytes of real hosts -----------------------------------------------------------------------


def test_identification_answers_eight_bytes(node: Node) -> None:
    node.now_us = 16_100_000
    answer = node.uart(bytes.fromhex("1F7F 80 1FFF"))
    assert answer == bytes.fromhex("1F7F 04 02 00 01 1000 6400 1FFF")


def test_capture_and_detect_is_acknowledged(node: Node) -> None:
    assert node.uart(bytes.fromhex("1F7F 14 00 00 1FFF")) == OK
    node.run()
    assert node.log == [("measure", Camera.SUN, Sram.SRAM1, True)]


def test_a_result_is_angles_and_two_codes(node: Node) -> None:
    node.command("CaptureAndDetect")
    expected = bytes.fromhex("1F7F D204 C9FD 02 07 1FFF")
    assert node.uart(bytes.fromhex("1F7F 96 1FFF")) == expected


def test_escapes_in_settings_are_undone(node: Node) -> None:
    assert node.uart(bytes.fromhex("1F7F 2D 1F1F 1F1F 1F1F 8080 1FFF")) == OK
    node.run()
    settings = node.state.cameras[Camera.NADIR]
    assert (settings.exposure, settings.gain) == (0x1F1F, 0x1F)
    assert (settings.blue_gain, settings.red_gain) == (0x80, 0x80)


def test_an_escape_in_a_frame_number_is_undone(node: Node) -> None:
    node.command("StartImageDownload", Size=ImageSize.SIDE_64)
    assert node.uart(bytes.fromhex("1F7F 41 1F1F 00 1FFF")) == OK
    node.run()
    assert node.telemetry("ImageFrameInfo")["FrameNumber"] == 31


def test_an_escape_in_an_answer_is_doubled(node: Node) -> None:
    node.command("CaptureAndDetect")
    node.state.results[Camera.SUN].alpha = 0x1F1F
    answer = node.uart(bytes.fromhex("1F7F 94 1FFF"))
    assert answer == bytes.fromhex("1F7F 1F1F1F1F C9FD 02 07 1FFF")


# --- acknowledges ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("payload", "error"),
    [
        ("01", AckError.INVALID_ID),
        ("7F", AckError.INVALID_ID),
        ("14 00", AckError.WRONG_LENGTH),
        ("14 00 00 00", AckError.WRONG_LENGTH),
        ("36" + "00" * 14, AckError.WRONG_LENGTH),
        ("36" + "00" * 16, AckError.WRONG_LENGTH),
        ("36" + "00" * 200, AckError.WRONG_LENGTH),
        ("14 02 00", AckError.BAD_PARAMETER),
        ("14 00 02", AckError.BAD_PARAMETER),
        ("15 00 00 01", AckError.BAD_PARAMETER),  # the bottom half
        ("15 00 00 02", AckError.BAD_PARAMETER),
        ("40 00 01 00", AckError.BAD_PARAMETER),
        ("40 00 00 05", AckError.BAD_PARAMETER),
        ("41 00 00", AckError.BAD_PARAMETER),  # before a picture is selected
        ("00 00", AckError.BAD_PARAMETER),
        ("00 04", AckError.BAD_PARAMETER),
        ("0B 03", AckError.BAD_PARAMETER),
        ("2A 02", AckError.BAD_PARAMETER),
        ("34 00" + "00" * 8, AckError.BAD_PARAMETER),
        ("34 06" + "00" * 8, AckError.BAD_PARAMETER),
        ("34 01 0200 0100 0000 0000", AckError.BAD_PARAMETER),  # ends before it begins
        ("36" + "00" * 15, AckError.BAD_PARAMETER),  # no inverse
        ("64 02", AckError.BAD_PARAMETER),
    ],
)
def test_what_is_refused(node: Node, payload: str, error: AckError) -> None:
    request = bytes.fromhex(payload)
    assert node.frames(request) == [bytes([error])]
    assert not node.queue
    processed = {"LastTcmd": request[0], "Processed": 1, "Error": error}
    assert node.telemetry("TcmdProcessed") == processed
    assert not node.state.flags


@pytest.mark.parametrize("size", ImageSize)
def test_frames_exist_up_to_the_selected_size(node: Node, size: ImageSize) -> None:
    node.command("StartImageDownload", Size=size)
    assert node.send("NextImageFrame", Frame=size.frames - 1) == AckError.OK
    assert node.send("NextImageFrame", Frame=size.frames) == AckError.BAD_PARAMETER


def test_the_fifth_telecommand_meets_a_full_buffer(node: Node) -> None:
    assert [node.send("CaptureAndDetect") for _ in range(6)] == [0, 0, 0, 0, 4, 4]
    assert node.telemetry("CommunicationStatus")["TcmdBufferOverrun"] == 1
    node.run()
    assert len(node.log) == 4
    assert node.send("CaptureAndDetect") == AckError.OK


def test_results_are_pending_before_the_acknowledge(node: Node) -> None:
    node.command("CaptureAndDetect")
    at_send = []
    send = node.uart_send

    def spy(data: bytes, port: Port = Port.NODE) -> None:
        result = node.state.results[Camera.SUN]
        at_send.append((result.capture, result.detect))
        send(data, port)

    node.uart_send = spy  # type: ignore[method-assign]
    node.send("CaptureAndDetect")
    node.send("CaptureOnly", Sram=Sram.SRAM2)
    assert at_send == [
        (CaptureResult.PENDING, DetectResult.PENDING),
        (CaptureResult.PENDING, DetectResult.NONE_SCHEDULED),
    ]
    assert node.state.results[Camera.SUN].sram == Sram.SRAM2


def test_a_refused_capture_changes_no_result(node: Node) -> None:
    node.command("CaptureAndDetect")
    assert node.send("CaptureOnly", Camera=Camera.NADIR) == AckError.OK
    node.run()
    assert node.frames(bytes.fromhex("15 00 00 01")) == [b"\x03"]
    for _ in range(4):
        node.send("ClearOverCurrent")
    assert node.send("CaptureAndDetect") == AckError.BUFFER_FULL
    assert node.state.results[Camera.SUN].detect is DetectResult.SUCCESS


# --- results that schedule ---------------------------------------------------------------------


@pytest.mark.parametrize("identifier", SCHEDULES)
def test_reading_a_result_schedules_the_next(node: Node, identifier: int) -> None:
    camera, sram = SCHEDULES[identifier]
    name = INTERFACE.telemetry(identifier).name
    values = node.telemetry(name)
    assert (values["Capture"], values["Detect"]) == (0, 0)
    again = node.telemetry(f"Result{camera + 1}")
    assert (again["Capture"], again["Detect"]) == (CaptureResult.PENDING, DetectResult.PENDING)
    node.run()
    assert node.log == [("measure", camera, sram, True)]
    assert node.woken


@pytest.mark.parametrize("identifier", SCHEDULES)
def test_on_i2c_it_does_so_when_the_transfer_has_ended(node: Node, identifier: int) -> None:
    camera, sram = SCHEDULES[identifier]
    node.outcome = CaptureResult.STORED_OTHER_SRAM
    node.command("CaptureAndDetect", Camera=camera)
    node.log.clear()
    node.link.i2c_start(False)
    node.link.i2c_write(identifier)
    node.link.i2c_start(True)
    assert bytes(node.link.i2c_read() or 0 for _ in range(6)) == bytes.fromhex("D204C9FD0307")
    assert not node.queue
    node.link.i2c_stop()
    assert len(node.queue) == 1
    node.run()
    assert node.log == [("measure", camera, sram, True)]


def test_a_schedule_that_is_not_read_is_none(node: Node) -> None:
    node.i2c_write(bytes([0x96]))
    node.i2c_read(0)
    assert not node.queue
    assert node.state.results[Camera.SUN].capture is CaptureResult.START_UP


def test_a_schedule_that_meets_a_full_queue_leaves_the_result(node: Node) -> None:
    node.command("CaptureAndDetect")
    for _ in range(4):
        node.send("ClearOverCurrent")
    assert node.telemetry("Result1ThenSram1")["Detect"] == DetectResult.SUCCESS
    assert node.telemetry("Result1")["Detect"] == DetectResult.SUCCESS
    assert node.telemetry("CommunicationStatus")["TcmdBufferOverrun"] == 1
    assert len(node.queue) == 4


# --- flags and counters --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "flag"),
    [
        ("00", "UartProtocolError"),
        ("1F7F 80 1F00", "UartProtocolError"),
        ("1F7F 1FFF", "UartProtocolError"),  # nothing in it
        ("1F7F FF 1FFF", "UartProtocolError"),  # no such telemetry
        ("1F7F 80 1F7F 80 1FFF", "UartMsgIncomplete"),
    ],
)
def test_damaged_frames_raise_a_flag(node: Node, data: str, flag: str) -> None:
    node.uart(bytes.fromhex(data))
    values = node.telemetry("CommunicationStatus")
    assert {name for name, value in values.items() if value and "Count" not in name} == {flag}


def test_unknown_telemetry_is_not_answered(node: Node) -> None:
    assert node.frames(b"\xff") == []


def test_silence_ends_a_frame(node: Node) -> None:
    node.link.uart_silence()
    assert not node.state.flags
    node.uart(bytes.fromhex("1F7F 14 00"))
    node.link.uart_silence()
    assert node.state.flags == {"UartMsgIncomplete"}
    assert node.uart(bytes.fromhex("00 1FFF")) == b""


def test_counters_count_every_message(node: Node) -> None:
    node.send("CaptureAndDetect")
    node.frames(b"\x01")
    node.telemetry("Identification")
    node.frames(b"\xff")
    node.i2c_read(2, 0x80)
    node.i2c_write(b"\x14")
    values = node.telemetry("CommunicationStatus")
    assert (values["TcmdCount"], values["TlmCount"]) == (3, 4)


def test_counters_wrap(node: Node) -> None:
    node.state.telecommands = node.state.telemetries = 0xFFFF
    node.send("ClearOverCurrent")
    values = node.telemetry("CommunicationStatus")
    assert (values["TcmdCount"], values["TlmCount"]) == (0, 0)


def test_an_answer_without_room_is_dropped(node: Node) -> None:
    node.backlog = SEND_BYTES - 12
    assert len(node.uart(bytes.fromhex("1F7F 80 1FFF"))) == 12
    node.backlog += 1
    assert node.uart(bytes.fromhex("1F7F 80 1FFF")) == b""
    assert node.uart(bytes.fromhex("1F7F 96 1FFF")) != b""
    node.run()
    node.log.clear()
    node.backlog = SEND_BYTES
    assert node.uart(bytes.fromhex("1F7F 96 1FFF")) == b""
    assert not node.queue  # a result that was not sent schedules nothing


def test_the_longest_answer_finds_room(node: Node) -> None:
    node.commands.download.data[:] = 0x1F
    assert len(node.uart(bytes.fromhex("1F7F C0 1FFF"))) == SEND_BYTES


def test_interrupts_charge_the_meter(node: Node) -> None:
    node.uart(bytes.fromhex("1F7F 80 1FFF"))
    assert node.meter.counts["uart_interrupt"] == 5 + 12  # bytes received and sent
    assert node.meter.counts["host_message"] == 1
    node.i2c_read(8, 0x80)
    assert node.meter.counts["i2c_interrupt"] == 9
    assert node.meter.counts["host_message"] == 2


# --- I2C -----------------------------------------------------------------------------------------


def test_telemetry_on_i2c(node: Node) -> None:
    node.now_us = 16_100_000
    assert node.i2c_read(10, 0x80) == bytes.fromhex("04 02 00 01 1000 6400 FFFF")
    assert node.i2c_write(b"\x80") == 1
    assert node.i2c_read(8) == bytes.fromhex("04 02 00 01 1000 6400")  # in a transfer of its own
    assert not node.state.flags


@pytest.mark.parametrize("identifier", [None, 0xFF])
def test_a_read_without_telemetry_raises_a_flag(node: Node, identifier: int | None) -> None:
    assert node.i2c_read(3, identifier) == b"\xff\xff\xff"
    assert node.telemetry("CommunicationStatus")["I2cTlmReadError"] == 1


def test_an_answer_is_read_once(node: Node) -> None:
    node.i2c_read(8, 0x80)
    assert not node.state.flags
    assert node.i2c_read(1) == b"\xff"
    assert node.state.flags == {"I2cTlmReadError"}


def test_a_telecommand_on_i2c_is_polled(node: Node) -> None:
    assert node.i2c_write(b"\x14\x01\x00") == 3
    assert node.i2c_read(3, 0x83) == bytes([20, 0, AckError.OK])
    node.run()
    assert node.log == [("measure", Camera.NADIR, Sram.SRAM1, True)]
    assert node.i2c_read(3, 0x83) == bytes([20, 1, AckError.OK])


def test_a_refused_telecommand_on_i2c_shows_its_error(node: Node) -> None:
    node.i2c_write(b"\x14\x02\x00")
    assert node.i2c_read(3, 0x83) == bytes([20, 1, AckError.BAD_PARAMETER])


def test_processed_speaks_of_the_last_telecommand(node: Node) -> None:
    node.send("CaptureAndDetect")
    node.send("DetectionThreshold1")
    node.run(1)
    assert node.telemetry("TcmdProcessed") == {"LastTcmd": 40, "Processed": 0, "Error": 0}
    node.run(1)
    assert node.telemetry("TcmdProcessed") == {"LastTcmd": 40, "Processed": 1, "Error": 0}


def test_a_telecommand_is_not_processed_while_it_runs(node: Node) -> None:
    seen = set()

    def look(_request: Request) -> None:
        seen.add(node.telemetry("TcmdProcessed")["Processed"])

    node.on_request = look
    node.send("CaptureAndDetect")
    node.run()
    assert 0 in seen
    assert node.telemetry("TcmdProcessed")["Processed"] == 1


def test_bytes_beyond_the_longest_telecommand_are_not_acknowledged(node: Node) -> None:
    assert node.i2c_write(bytes([54]) + bytes(40)) == longest_command(INTERFACE) + 1
    assert node.i2c_read(3, 0x83) == bytes([54, 1, AckError.WRONG_LENGTH])


def test_a_repeated_start_ends_a_telecommand(node: Node) -> None:
    node.link.i2c_start(False)
    for byte in b"\x14\x00\x00":
        node.link.i2c_write(byte)
    assert node.i2c_read(3, 0x83) == bytes([20, 0, AckError.OK])


def test_all_messages_of_the_table_are_answered(node: Node) -> None:
    for message in INTERFACE.telemetries:
        (answer,) = node.frames(bytes([message.id]) + b"ignored")
        assert len(answer) == message.length
        assert len(node.i2c_read(message.length, message.id)) == message.length
        node.run()
    for message in INTERFACE.telecommands:
        (answer,) = node.frames(bytes([message.id]) + message.pack(**message.reset_values()))
        assert answer == bytes([AckError.OK]), message.name
        node.run()
        assert encode_frame(answer) == OK
