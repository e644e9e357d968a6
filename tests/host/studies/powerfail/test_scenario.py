"""Keys of a scenario's file, and what is said about wrong ones."""

from pathlib import Path

import pytest

from cubestack.host.studies.powerfail.scenario import Scenario, ScenarioError

RIGHT = """
device = "cubestar"
[[question]]
name = "gain"
send = "g\\n"
[[step]]
send = "s 1\\n"
answer = "ok"
state.gain = "1"
"""


def read(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    return Scenario.read(path)


def test_a_scenario_has_defaults(tmp_path: Path) -> None:
    scenario = read(tmp_path, RIGHT)
    assert scenario.question[0].end == "\n"
    assert scenario.step[0].state == {"gain": "1"}
    assert (scenario.torn, scenario.between, scenario.line) == (3, 0, "")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('device = "cubestar"', "", "needs the key device"),
        ("answer =", "reply =", "step: unknown key 'reply'"),
        ('answer = "ok"', "", "step: a step with send needs an answer"),
        ('send = "g\\n"', "", "question: needs either send or telemetry"),
        ('send = "g\\n"', 'send = "g"\ntelemetry = "T"', "question: needs either send or"),
        ("state.gain", "state.loss", "step 1: no question 'loss'"),
        ('state.gain = "1"', "state.gain = 1", "step 1: gain must be text, not 1"),
        ('device = "cubestar"', 'device = "cubestar"\ntorn = -1', "torn must be at least 0"),
        (
            'device = "cubestar"',
            'device = "cubestar"\nbrown_out = [{ curve = [[0, 3.3], [1, 3.0]] }]',
            "curve never falls below 1.8 V",
        ),
        (
            'device = "cubestar"',
            'device = "cubestar"\nbrown_out = [{ curve = [[0, 3.3], [1, 1.0]] }]',
            "the supply must end above 1.85 V",
        ),
        (
            'device = "cubestar"',
            'device = "cubestar"\nbrown_out = [{ curve = [[1, 3.3], [1, 1.0]] }]',
            "curve must have two corners or more, at rising times",
        ),
    ],
)
def test_errors_name_file_and_key(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in RIGHT
    with pytest.raises(ScenarioError, match=message) as error:
        read(tmp_path, RIGHT.replace(old, new, 1))
    assert str(error.value).startswith(str(tmp_path))
    assert "\n" not in str(error.value)
