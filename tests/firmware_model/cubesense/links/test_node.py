"""The node protocol: bytes of real hosts, errors, both buses."""

import pytest

from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.links.node import SEND_BYTES
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, telemetry

from ..links_harness import Links

OK = bytes.fromhex("1F7F 00 1FFF")


def test_identification_answers_eight_bytes(node: Links) -> None:
    node.now_us = 16_100_000
    answer = node.wire(bytes.fromhex("1F7F 80 1FFF"))
    assert answer == bytes.fromhex("1F7F 04 02 00 01 1000 6400 1FFF")


def test_capture_and_detect_is_acknowledged(node: Links) -> None:
    assert node.wire(bytes.fromhex("1F7F 14 00 00 1FFF")) == OK
    node.run()
    assert node.done == [("measure", codes.Camera.SUN, codes.Sram.SRAM1, True)]


@pytest.mark.parametrize(
    ("request_id", "alpha", "answer"),
    [("96", None, "D204 C9FD 02 07"), ("94", 0x1F1F, "1F1F1F1F C9FD 02 07")],  # escapes doubled
)
def test_result_telemetry_has_capture_and_detect_codes(
    node: Links, request_id: str, alpha: int | None, answer: str
) -> None:
    node.command("CaptureAndDetect")
    if alpha is not None:
        node.state.results[codes.Camera.SUN].alpha = alpha
    found = node.wire(bytes.fromhex(f"1F7F {request_id} 1FFF"))
    assert found == bytes.fromhex(f"1F7F {answer} 1FFF")


def test_escaped_bytes_in_settings_are_decoded(node: Links) -> None:
    assert node.wire(bytes.fromhex("1F7F 2D 1F1F 1F1F 1F1F 8080 1FFF")) == OK
    node.run()
    settings = node.state.cameras[codes.Camera.NADIR]
    assert (settings.exposure, settings.gain) == (0x1F1F, 0x1F)
    assert (settings.blue_gain, settings.red_gain) == (0x80, 0x80)


def test_escaped_byte_in_a_frame_number_is_decoded(node: Links) -> None:
    node.command("StartImageDownload", Size=codes.ImageSize.SIDE_64)
    assert node.wire(bytes.fromhex("1F7F 41 1F1F 00 1FFF")) == OK
    node.run()
    assert node.telemetry("ImageFrameInfo")["FrameNumber"] == 31


@pytest.mark.parametrize(
    ("payload", "error"),
    [
        ("01", AckError.INVALID_ID),
        ("14 00", AckError.WRONG_LENGTH),
        ("14 02 00", AckError.BAD_PARAMETER),
        ("15 00 00 01", AckError.BAD_PARAMETER),  # the bottom half
        ("41 00 00", AckError.BAD_PARAMETER),  # before a picture is selected
        ("34 01 0200 0100 0000 0000", AckError.BAD_PARAMETER),  # ends before it begins
        ("36" + "00" * 15, AckError.BAD_PARAMETER),  # no inverse
        ("64 02", AckError.BAD_PARAMETER),
    ],
)
def test_telecommands_are_rejected_with_their_error(
    node: Links, payload: str, error: AckError
) -> None:
    request = bytes.fromhex(payload)
    assert node.frames(request) == [bytes([error])]
    assert not node.queue
    processed = {"LastTcmd": request[0], "Processed": 1, "Error": error}
    assert node.telemetry("TcmdProcessed") == processed
    assert not node.state.flags


@pytest.mark.parametrize("size", codes.ImageSize)
def test_frames_exist_up_to_the_selected_size(node: Links, size: codes.ImageSize) -> None:
    node.command("StartImageDownload", Size=size)
    assert node.send("NextImageFrame", Frame=size.frames - 1) == AckError.OK
    assert node.send("NextImageFrame", Frame=size.frames) == AckError.BAD_PARAMETER


def test_results_are_pending_before_the_acknowledge(node: Links) -> None:
    node.command("CaptureAndDetect")
    at_send = []
    send = node.uart_send

    def spy(data: bytes, port: Port = Port.NODE) -> None:
        result = node.state.results[codes.Camera.SUN]
        at_send.append((result.capture, result.detect))
        send(data, port)

    node.uart_send = spy  # type: ignore[method-assign]
    node.send("CaptureAndDetect")
    node.send("CaptureOnly", Sram=codes.Sram.SRAM2)
    assert at_send == [
        (codes.CaptureResult.PENDING, codes.DetectResult.PENDING),
        (codes.CaptureResult.PENDING, codes.DetectResult.NONE_SCHEDULED),
    ]
    assert node.state.results[codes.Camera.SUN].sram == codes.Sram.SRAM2


def test_a_refused_capture_changes_no_result(node: Links) -> None:
    node.command("CaptureAndDetect")
    node.command("CaptureOnly", Camera=codes.Camera.NADIR)
    assert node.frames(bytes.fromhex("15 00 00 01")) == [b"\x03"]
    for _ in range(4):
        node.send("ClearOverCurrent")
    assert node.send("CaptureAndDetect") == AckError.BUFFER_FULL
    assert node.state.results[codes.Camera.SUN].detect is codes.DetectResult.SUCCESS


@pytest.mark.parametrize("identifier", telemetry.SCHEDULES)
def test_reading_a_result_schedules_the_next(node: Links, identifier: int) -> None:
    camera, sram = telemetry.SCHEDULES[identifier]
    name = INTERFACE.telemetry(identifier).name
    values = node.telemetry(name)
    assert (values["Capture"], values["Detect"]) == (0, 0)
    again, pending = node.telemetry(f"Result{camera + 1}"), codes.CaptureResult.PENDING
    assert (again["Capture"], again["Detect"]) == (pending, codes.DetectResult.PENDING)
    node.run()
    assert node.done == [("measure", camera, sram, True)]
    assert node.woken


@pytest.mark.parametrize("identifier", telemetry.SCHEDULES)
def test_i2c_result_read_schedules_at_the_end_of_the_transfer(node: Links, identifier: int) -> None:
    camera, sram = telemetry.SCHEDULES[identifier]
    node.outcome = codes.CaptureResult.STORED_OTHER_SRAM
    node.command("CaptureAndDetect", Camera=camera)
    node.done.clear()
    node.link.i2c_start(False)
    node.link.i2c_write(identifier)
    node.link.i2c_start(True)
    assert bytes(node.link.i2c_read() or 0 for _ in range(6)) == bytes.fromhex("D204C9FD0307")
    assert not node.queue
    node.link.i2c_stop()
    assert len(node.queue) == 1
    node.run()
    assert node.done == [("measure", camera, sram, True)]


def test_read_of_zero_bytes_schedules_nothing(node: Links) -> None:
    node.i2c_write(bytes([0x96]))
    node.i2c_read(0)
    assert not node.queue
    assert node.state.results[codes.Camera.SUN].capture is codes.CaptureResult.START_UP


def test_result_survives_a_schedule_refused_by_a_full_queue(node: Links) -> None:
    node.command("CaptureAndDetect")
    for _ in range(4):
        node.send("ClearOverCurrent")
    assert node.telemetry("Result1ThenSram1")["Detect"] == codes.DetectResult.SUCCESS
    assert node.telemetry("Result1")["Detect"] == codes.DetectResult.SUCCESS
    assert node.telemetry("CommunicationStatus")["TcmdBufferOverrun"] == 1
    assert len(node.queue) == 4


def test_counters_count_every_message_and_wrap(node: Links) -> None:
    node.send("CaptureAndDetect")
    node.frames(b"\x01")
    node.telemetry("Identification")
    node.frames(b"\xff")
    node.i2c_read(2, 0x80)
    node.i2c_write(b"\x14")
    values = node.telemetry("CommunicationStatus")
    assert (values["TcmdCount"], values["TlmCount"]) == (3, 4)
    node.state.telecommands = node.state.telemetries = 0xFFFF
    node.send("ClearOverCurrent")
    values = node.telemetry("CommunicationStatus")
    assert (values["TcmdCount"], values["TlmCount"]) == (0, 0)


def test_unsent_result_schedules_no_measurement(node: Links) -> None:
    node.backlog = SEND_BYTES
    assert node.wire(bytes.fromhex("1F7F 96 1FFF")) == b""
    assert not node.queue


def test_longest_answer_fits_the_send_buffer(node: Links) -> None:
    node.commands.download.data[:] = 0x1F
    assert len(node.wire(bytes.fromhex("1F7F C0 1FFF"))) == SEND_BYTES


def test_i2c_telecommand_is_polled_until_processed(node: Links) -> None:
    assert node.i2c_write(b"\x14\x01\x00") == 3
    assert node.i2c_read(3, 0x83) == bytes([20, 0, AckError.OK])
    node.run()
    assert node.done == [("measure", codes.Camera.NADIR, codes.Sram.SRAM1, True)]
    assert node.i2c_read(3, 0x83) == bytes([20, 1, AckError.OK])
    node.i2c_write(b"\x14\x02\x00")
    assert node.i2c_read(3, 0x83) == bytes([20, 1, AckError.BAD_PARAMETER])


def test_processed_flag_refers_to_the_last_telecommand(node: Links) -> None:
    node.send("CaptureAndDetect")
    node.send("DetectionThreshold1")
    node.run(1)
    assert node.telemetry("TcmdProcessed") == {"LastTcmd": 40, "Processed": 0, "Error": 0}
    node.run(1)
    assert node.telemetry("TcmdProcessed") == {"LastTcmd": 40, "Processed": 1, "Error": 0}


def test_telecommand_is_not_marked_processed_while_it_runs(node: Links) -> None:
    seen: set[int] = set()
    node.on_request = lambda _request: seen.add(node.telemetry("TcmdProcessed")["Processed"])
    node.command("CaptureAndDetect")
    assert 0 in seen
    assert node.telemetry("TcmdProcessed")["Processed"] == 1
