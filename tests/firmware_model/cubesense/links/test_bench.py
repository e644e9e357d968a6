import re
from pathlib import Path

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.download import CHUNK_BYTES
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.links.bench import LETTERS
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.codes import (
    IMAGE_BYTES,
    Camera,
    CaptureResult,
    DetectResult,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.firmware_model.interface.cubesense.service_port import CAPTURES, DOWNLOADS
from tests.tiers import quick, quick_ones

from ..harness import Harness
from ..links_harness import BENCH_BYTE_US, Links

IMAGE = REGISTERS["IMAGE"].address


@pytest.mark.parametrize(("letter", "camera"), [(b"a", Camera.NADIR), (b"q", Camera.SUN)])
def test_bench_letter_captures_with_its_camera(node: Links, letter: bytes, camera: Camera) -> None:
    assert CAPTURES[camera].request == letter
    for byte in letter:
        node.bench.uart_byte(byte)
    assert node.bench_sent == b""
    assert node.woken
    assert node.letters(b"") == b"Y"
    assert node.done == [("measure", camera, Sram(camera), False)]
    assert node.telemetry(f"Result{camera + 1}")["Detect"] == DetectResult.NONE_SCHEDULED


@pytest.mark.parametrize("outcome", [CaptureResult.CAMERA_TIMEOUT, CaptureResult.SRAM_OVER_CURRENT])
def test_bench_does_not_answer_a_failed_capture(node: Links, outcome: CaptureResult) -> None:
    node.outcome = outcome
    assert node.letters(b"aq") == b""
    node.outcome = CaptureResult.STORED_OWN_SRAM
    assert node.letters(b"a") == b"Y"


@pytest.mark.parametrize(("letter", "camera"), quick([(b"s", Camera.NADIR), (b"w", Camera.SUN)], 1))
def test_image_is_sent_at_the_line_rate_with_at_most_two_chunks_waiting(
    node: Links, letter: bytes, camera: Camera
) -> None:
    assert DOWNLOADS[camera].request == letter
    backlogs: list[int] = []
    node.on_request = lambda _request: backlogs.append(node.uart_backlog(Port.BENCH))
    assert node.letters(letter) == node.pictures[camera].tobytes()
    assert max(backlogs) <= 2 * CHUNK_BYTES
    assert node.opened == [Sram(camera)]
    assert node.now_us / 1e6 == pytest.approx(IMAGE_BYTES * BENCH_BYTE_US / 1e6, rel=0.02)


@pytest.mark.slow
def test_letters_are_answered_in_their_order(node: Links) -> None:
    answer = node.letters(b"qsaw")
    nadir, sun = node.pictures[Camera.NADIR].tobytes(), node.pictures[Camera.SUN].tobytes()
    assert answer == b"Y" + nadir + b"Y" + sun


def test_excess_bench_letters_are_dropped(node: Links) -> None:
    assert node.letters(b"a" * (LETTERS + 3)) == b"Y" * LETTERS
    assert node.letters(b"a") == b"Y"


def test_bench_ignores_bytes_that_are_no_letters(node: Links) -> None:
    letters = {letter.request[0] for letter in (*CAPTURES.values(), *DOWNLOADS.values())}
    assert node.letters(bytes(byte for byte in range(256) if byte not in letters)) == b""
    node.bench.uart_silence()
    assert node.done == []
    assert not node.queue
    assert not node.state.flags


def test_bench_letters_and_telecommands_have_separate_queues(node: Links) -> None:
    for _ in range(LETTERS):
        node.bench.uart_byte(ord("a"))
    assert [node.send("CaptureOnly") for _ in range(5)] == [0, 0, 0, 0, 4]
    node.run()
    assert [entry[1] for entry in node.done] == [Camera.SUN] * 4 + [Camera.NADIR] * 4


def test_telecommand_is_executed_during_a_bench_download(node: Links) -> None:
    node.bench.uart_byte(ord("s"))
    node.run(5)
    node.send("CaptureOnly", Sram=Sram.SRAM1)
    node.run(1)
    assert node.done
    node.run()
    assert bytes(node.bench_sent) == node.pictures[Camera.NADIR].tobytes()
    assert len(node.opened) == 2


def test_register_stream_waits_for_the_end_of_a_bench_download(node: Links) -> None:
    node.bench.uart_byte(ord("w"))
    node.run(5)
    data = node.read_register(100, IMAGE)
    assert data == node.pictures[0, :100].tobytes()
    assert bytes(node.bench_sent) == node.pictures[Camera.SUN].tobytes()
    assert len(node.opened) == 2


@pytest.mark.parametrize("when", quick_ones(["before", "meanwhile"], "meanwhile"))
def test_bench_download_ends_when_the_memory_loses_its_supply(node: Links, when: str) -> None:
    if when == "before":
        node.off = {Sram.SRAM2}
    else:
        node.on_request = lambda _: node.off.update({Sram.SRAM2} if node.read > 5000 else ())
    answer = node.letters(b"sa")
    whole = node.pictures[Camera.NADIR].tobytes()
    assert answer.endswith(b"Y")
    assert whole.startswith(answer[:-1])
    assert (len(answer) > 1) is (when == "meanwhile")
    assert node.letters(b"w") == node.pictures[Camera.SUN].tobytes()


PAGE = Path(__file__).parents[4] / "docs" / "sensors" / "protocols-cubesense.md"
WRITE, READ = REGISTERS.i2c_address << 1, REGISTERS.i2c_address << 1 | 1
THRESHOLD = REGISTERS["SUN_THRESHOLD"].address


def said(unit: Harness, *message: int) -> bytes:
    for byte in message:
        unit.program.backup.uart_byte(byte)
    answer = bytes(unit.sent)
    unit.sent.clear()
    return answer


def test_documented_backup_uart_examples_work(unit: Harness) -> None:
    (block,) = re.findall(r"```registers\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    lines = block.splitlines()
    for request, answer in zip(lines[::2], lines[1::2], strict=True):
        given = bytes.fromhex(request.removeprefix("-> "))
        assert said(unit, *given).hex(" ") == answer[2:].strip(), request
    unit.run()
    assert said(unit, READ, 0x28) == bytes([codes.CaptureResult.STORED_OWN_SRAM])


def test_backup_uart_returns_the_same_register_values_as_i2c(unit: Harness) -> None:
    for register in REGISTERS:
        if register.readable and not register.streams:
            expected = unit.read_register(register.length, register.address)
            assert said(unit, READ, register.address) == expected
        elif not register.readable:
            assert said(unit, READ, register.address) == b""
    assert said(unit, READ, 0xEE) == b""


def test_backup_uart_ignores_writes_to_read_only_registers(unit: Harness) -> None:
    before = [said(unit, READ, r.address) for r in REGISTERS if r.readable and not r.streams]
    for address, value in ((0x20, 1), (0x05, 2), (0xEE, 1), (IMAGE, 1)):
        assert said(unit, WRITE, address, value) == b""
    after = [said(unit, READ, r.address) for r in REGISTERS if r.readable and not r.streams]
    assert after == before


def test_backup_uart_ignores_noise_and_incomplete_messages(unit: Harness) -> None:
    assert said(unit, 0x00, 0x1F, WRITE - 2, READ, THRESHOLD) == b"\xe1"
    said(unit, WRITE, THRESHOLD)
    unit.program.backup.uart_silence()
    assert said(unit, READ, THRESHOLD) == b"\xe1"
    said(unit, WRITE, THRESHOLD, WRITE)  # data may look like an address
    assert said(unit, READ, THRESHOLD) == bytes([WRITE])


@pytest.mark.slow
def test_backup_uart_sends_the_image_until_another_message(unit: Harness) -> None:
    rng = np.random.default_rng(1)
    for sram in codes.Sram:
        unit.memories[sram] = rng.integers(0, 256, (480, 640), np.uint8)
    said(unit, READ, IMAGE)
    unit.run()
    assert bytes(unit.sent) == unit.memories[codes.Sram.SRAM1].tobytes()
    unit.sent.clear()
    said(unit, WRITE, REGISTERS["IMAGE_SRAM"].address, 1)
    said(unit, READ, IMAGE)
    unit.run(unit.now_us + 20_000)
    part = bytes(unit.sent)
    assert unit.memories[codes.Sram.SRAM2].tobytes().startswith(part)
    unit.sent.clear()
    assert said(unit, READ, THRESHOLD)[-1:] == b"\xe1"
    unit.run()
    assert len(part) < 307_200
    assert len(unit.sent) < 100
