"""A full disk ends a recording, not the emulation; what is on the disk replays."""

import errno
import os
import random
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cubestack.emulator.recording.replay import Replay
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.emulation.emulated import open_device
from cubestack.host.emulation.records import create_record, start_recorder
from cubestack.host.output import Outputs
from cubestack.host.recording.record_file import RecordFile
from cubestack.host.recording.setups import emulated_setup

MOMENTS = 30


@contextmanager
def largest_file(count: int) -> Iterator[None]:
    """Files of this process end at ``count`` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (count, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def test_emulation_goes_on_and_the_rest_replays(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert fill_disk(tmp_path / "some.rec", 1500) > 0
    assert "it ends here, and the emulation goes on" in caplog.text


@pytest.mark.slow
def test_disk_may_be_full_at_any_moment(tmp_path: Path) -> None:
    rng = random.Random(9)
    for number in range(MOMENTS):
        fill_disk(tmp_path / f"{number}.rec", rng.randrange(1000, 5000))


def fill_disk(path: Path, room: int) -> int:
    """The device answers as before while its recording reaches ``room`` bytes; what came before
    replays. Returns the number of recorded events."""
    with Outputs() as stack:
        device = stack.enter_context(open_device("cubesense", seed=3, engine="python"))
        recorder = start_recorder(device, create_record(path, stack), emulated_setup(3, None))
        stack.callback(recorder.close)
        stack.keep()
        client = device.client.client
        with largest_file(room):
            for _ in range(30):
                assert client.telemetry("Identification")
                recorder.flush()
    assert path.stat().st_size <= room
    found = load_recording(path)
    again = open_device("cubesense", seed=3, engine="python")
    with again:
        replay = Replay(found, again.board.kernel, again.board.uarts, again.board.i2c_bus)
        assert replay.run(again.device.interface) == []
    return len(found.events)


def test_disk_that_is_full_at_the_start_loses_no_earlier_file(tmp_path: Path) -> None:
    path = tmp_path / "some.rec"
    path.write_text("earlier")

    def start() -> None:
        with largest_file(1500), Outputs() as files:
            create_record(path, files).write("x" * 10_000)
            files.keep()

    with pytest.raises(OSError, match=r"some\.rec: File too large"):
        start()
    assert path.read_text() == "earlier"


def test_ends_with_a_whole_line_wherever_the_disk_is_full(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Also with text above the buffer, and where the disk takes a part of a line."""
    rng = random.Random(4)
    lines = ["x" * rng.choice([1, 30, 70_000]) + "\n" for _ in range(20)]
    whole = "".join(lines)
    for _ in range(MOMENTS):
        room = rng.randrange(1, len(whole))
        path = tmp_path / "some.rec"
        caplog.clear()
        with path.open("w") as stream, largest_file(room):
            file = RecordFile(stream)
            for line in lines:
                assert file.write(line) == len(line)
            file.flush()
            file.write("more\n")
            file.flush()
        text = path.read_text()
        assert whole.startswith(text)
        assert text == "" or text.endswith("\n")
        assert len(text) <= room < len(text) + len(lines[text.count("\n")])
        (said,) = caplog.messages
        assert said.startswith(f"{path}: {os.strerror(errno.EFBIG)}; it ends here")
        assert file.stopped


def test_writes_everything_while_there_is_room(tmp_path: Path) -> None:
    path = tmp_path / "some.rec"
    with path.open("w") as stream:
        file = RecordFile(stream)
        for index in range(10_000):
            file.write(f"{index} ä\n")
        file.flush()
    assert path.read_text() == "".join(f"{index} ä\n" for index in range(10_000))
    assert not file.stopped


def test_size_can_be_bounded(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "some.rec"
    with path.open("w") as stream:
        file = RecordFile(stream, largest=1 << 20)
        for _ in range(100):
            file.write("x" * 30_000 + "\n")
        file.flush()
    assert 0 < path.stat().st_size <= 1 << 20
    assert path.read_text().endswith("\n")
    assert "it has reached 1 MB" in caplog.text
