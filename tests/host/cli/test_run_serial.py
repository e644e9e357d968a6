"""`cubestack run --serial`: programs on the serial lines of emulated devices."""

import sys
from pathlib import Path

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.emulation.emulated import open_device

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
    pytest.mark.skipif(sys.platform != "linux", reason="Linux only"),
]

CLIENT = """
import serial, sys
for path in sys.argv[2:]:
    with serial.Serial(path, 57600, timeout=20) as port:
        port.write(bytes.fromhex("1f7f801fff"))
        print(port.read(12)[2], file=open(sys.argv[1], "a"))
sys.exit(5)
"""


def test_program_reaches_each_device_and_its_exit_status_is_returned(run, tmp_path: Path) -> None:
    said = tmp_path / "said"
    client = (sys.executable, "-c", CLIENT, str(said), "{port}", "{cubesense}")
    devices = ("--serial", "cubestar", "--serial", "cubesense", "--pace", "fast")
    outcome = run("run", *devices, "--", *client)
    assert outcome.code == 5
    assert said.read_text().split() == ["5", "4"]  # node types
    lines = outcome.err.splitlines()
    assert [line.split("/")[0] for line in lines if " serves on " in line] == [
        "CubeStar serves on ",
        "CubeSense serves on ",
    ]


def test_further_line_has_a_suffix_and_a_signal_ends_the_program(run) -> None:
    script = "test -c $1.bench && kill -TERM $$"
    words = ("--quiet", "--serial", "cubesense", "--", "sh", "-c", script, "sh", "{port}")
    assert run("run", *words).code == 128 + 15


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("--serial cubestar -- true", "no word of the program is a port; write {port}"),
        ("--serial cubestar --attach -- true {port}", "--attach is for I2C"),
        ("--serial cubestar --route preload -- true {port}", "--route is for I2C"),
        ("--serial cubestar --serial cubestar -- true {port}", "name each device once"),
        ("--strict-line -- true", "--strict-line goes with --serial"),
        ("--serial cubestar -- no-such {port}", "no-such: no such program"),
    ],
)
def test_rejects_calls_without_a_port_or_with_options_of_i2c(run, words: str, text: str) -> None:
    outcome = run("run", *words.split())
    assert outcome.code in (1, 2)
    assert text in outcome.err


def test_fixture_runs_a_program_on_the_lines_of_several_devices(tmp_path: Path) -> None:
    said = tmp_path / "said"
    client = (sys.executable, "-c", CLIENT, said, "{port}", "{cubesense}")
    with open_device("cubestar") as star, open_device("cubesense") as sense:
        assert star.run(*client, beside=[sense]).returncode == 5
        done = sense.run("sh", "-c", "test -c {port}.bench && echo out")
    assert said.read_text().split() == ["5", "4"]
    assert (done.returncode, done.stdout) == (0, "out\n")


def test_fixture_returns_status_and_output_of_a_program_on_i2c() -> None:
    with open_device("cubestar") as star:
        done = star.run_on_i2c("sh", "-c", "test -c /dev/i2c-7 && echo out; echo err >&2; exit 3")
    assert (done.returncode, done.stdout, done.stderr) == (3, "out\n", "err\n")
