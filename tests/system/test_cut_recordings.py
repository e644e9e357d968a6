"""A recording whose process was killed replays up to its last whole event."""

import os
import random
from pathlib import Path

import pytest

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.targets import open_target

from ..conftest import Run
from ..forked import Forked
from ..tiers import quick, todays


def session(path: Path, done: int) -> None:
    """Records; writes a byte to the file ``done`` after each exchange."""
    target = open_target("emulated:cubesense", record=path, seed=3)
    for number in range(1000):
        target.node.command("DetectionThreshold1", Threshold=number % 200)
        target.node.telemetry("Configuration")
        os.write(done, b".")


LONGEST = 400  # exchanges
TURNS, SEEDS = 8, 100


@pytest.mark.parametrize("turn", quick(range(TURNS), 1))
def test_killed_recording_replays(run: Run, tmp_path: Path, turn: int) -> None:
    path = tmp_path / "cut.rec"
    count = random.Random(todays(turn, TURNS, SEEDS)).randrange(1, LONGEST)
    print(f"killed after {count} exchanges")
    reading, writing = os.pipe()
    with Forked(lambda: session(path, writing)):  # which ends it
        for _ in range(count):
            assert os.read(reading, 1)
    os.close(reading)
    os.close(writing)
    recording = load_recording(path)
    assert not recording.whole
    assert len(recording.events) <= 4 * LONGEST
    outcome = run("replay", path)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.endswith("no difference; the recording was cut off there\n")
