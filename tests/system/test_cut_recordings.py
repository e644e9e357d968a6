"""A recording whose process was killed replays up to its last whole event."""

import random
import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.firmware_model.formats.recording import load_recording

from ..conftest import Run
from ..tiers import quick, todays

SESSION = """
import sys
from pathlib import Path
from cubestack.host.targets import open_target

target = open_target("emulated:cubesense", record=Path(sys.argv[1]), seed=3)
for number in range(1000):
    target.node.command("DetectionThreshold1", Threshold=number % 200)
    target.node.telemetry("Configuration")
    print(number, flush=True)
"""
LONGEST = 400  # exchanges
TURNS, SEEDS = 8, 100


@pytest.mark.parametrize("turn", quick(range(TURNS), 1))
def test_killed_recording_replays(run: Run, tmp_path: Path, turn: int) -> None:
    path = tmp_path / "cut.rec"
    count = random.Random(todays(turn, TURNS, SEEDS)).randrange(1, LONGEST)
    print(f"killed after {count} exchanges")
    with subprocess.Popen(
        [sys.executable, "-c", SESSION, path], stdout=subprocess.PIPE, text=True
    ) as session:
        assert session.stdout is not None
        for _ in range(count):
            session.stdout.readline()
        session.kill()
    recording = load_recording(path)
    assert not recording.whole
    assert len(recording.events) <= 4 * LONGEST
    outcome = run("replay", path)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.endswith("no difference; the recording was cut off there\n")
