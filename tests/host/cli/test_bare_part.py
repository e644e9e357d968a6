"""`cubestack emulate` with the microcontroller alone."""

import sys
from pathlib import Path

import pytest

from cubestack.host.cli.main import main
from cubestack.host.emulation.emulated import open_device
from cubestack.host.emulation.remote_controls import TOKEN, ControlClient
from cubestack.host.errors import TargetError
from tests.emulator.boards.efm32gg.programs import application, needs_both_compilers, unit_tests
from tests.emulator.recording import vcd
from tests.forked import Served

pytestmark = needs_both_compilers

PRESS = """$timescale 1 us $end
$var wire 1 ! PB9 $end
$enddefinitions $end
#10000 0!
#10200 1!
#10500 0!
#40000 z!
#60000 0!
"""


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(application(tmp_path_factory.mktemp("app")))


@pytest.fixture(scope="module")
def tests_elf(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(unit_tests(tmp_path_factory.mktemp("unit")))


def fast(firmware: str, *words: str) -> int:
    return main(["emulate", "efm32gg", "--firmware", firmware, "--pace", "fast", *words])


def test_unit_tests_end_it_with_their_status(
    tests_elf: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    covered = tmp_path / "cov.info"
    words = ["--semihosting", "--tcp", "0", "--timeout", "5s", "--coverage-out", str(covered)]
    assert fast(tests_elf, *words) == 0
    said = capsys.readouterr().err
    assert "ok   bounces: one press" in said
    assert "exited by semihosting with status 0" in said
    record = covered.read_text().split("end_of_record")[0]
    assert "debounce.c" in record
    assert "FNDA:58,debounce" in record  # the number of levels in unit_tests.c
    assert "LF:8\nLH:8" in record


def test_time_out_is_a_failure_in_virtual_time(
    app: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fast(app, "--tcp", "0", "--timeout", "300ms") == 1
    assert "time-out: 0.3 s of virtual time have passed" in capsys.readouterr().err


@pytest.mark.parametrize("time", ["0", "-1", "5x", "s", "nan"])
def test_time_out_must_be_a_time(time: str, app: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        fast(app, "--timeout", time)
    assert "--timeout: must be a" in capsys.readouterr().err


def test_stimulus_presses_the_button_and_the_trace_shows_the_led(app: str, tmp_path: Path) -> None:
    stimulus, trace = tmp_path / "press.vcd", tmp_path / "out.vcd"
    stimulus.write_text(PRESS)
    words = ["--stimulus", str(stimulus), "--trace", str(trace), "--timeout", "0.1"]
    assert fast(app, *words, "--tcp", "0") == 1
    with trace.open("rb") as stream:
        changes = vcd.read(stream)
    us = [(at_ns / 1000, level) for at_ns, level in changes["pins.PB9"]]
    assert us[0] == (0, "z")
    assert us[1:] == [(10_000, 0), (10_200, 1), (10_500, 0), (40_000, "z"), (60_000, 0)]
    (_, off), (on_ns, on), (off_ns, last) = changes["pins.PE2"][-3:]
    assert (off, on, last) == (0, 1, 0)
    assert 14_000_000 < on_ns < 15_600_000  # five ticks after the bounces
    assert 64_000_000 < off_ns < 65_600_000


def test_serial_blocks_lead_to_places_of_their_own(app: str, tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    words = ["--serial", f"uart0@PE0,PE1:{first}", "--serial", f"usart1@PD0,PD1:{second}"]
    with Served(["efm32gg", "--firmware", app, *words], tmp_path) as served:
        line = served.said.splitlines()[-1]
        assert f"uart0@PE0,PE1 on {first} at 115200 baud" in line
        assert f"usart1@PD0,PD1 on {second} at 115200 baud" in line
        assert first.is_symlink()
        assert second.is_symlink()


def test_serial_block_of_a_sensors_board_has_its_own_port(app: str, tmp_path: Path) -> None:
    star = ["cubestar", "--firmware", app, "--pty", str(tmp_path / "star")]
    with Served([*star, "--serial", "uart0@PE0,PE1:0"], tmp_path) as served:
        line = served.said.splitlines()[-1]
        assert f"serves on {tmp_path / 'star'} at 57600 baud, uart0@PE0,PE1 on tcp://" in line


def test_control_port_drives_pins_and_reads_them(
    app: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(TOKEN, "secret")
    words = ["efm32gg", "--firmware", app, "--tcp", "0", "--control", "0", "--pace", "fast"]
    with Served(words, tmp_path) as served:
        (line,) = (one for one in served.said.splitlines() if one.startswith("control on"))
        client = ControlClient(line.split()[2].rstrip(","), "secret")

        def act(*words: str) -> None:
            client.ask("POST", "/devices/efm32gg/act", {"words": words})

        def led_at(to_s: float) -> tuple[int, int]:
            client.ask("POST", "/run", {"to_s": to_s})
            pins = client.ask("GET", "/devices/efm32gg/pins")["pins"]
            assert pins["PB10"] == {"level": 0, "output": None}
            return pins["PE2"]["output"], pins["PB9"]["level"]

        client.ask("POST", "/pause")
        now_s = client.ask("GET", "/state")["time_s"]
        assert led_at(now_s + 0.1) == (0, 1)
        act("pin", "PB9", "0")
        assert led_at(now_s + 0.2) == (1, 0)
        act("pin", "PB9", "z")
        assert led_at(now_s + 0.3) == (1, 1)
        for wrong, error in (
            (("pin", "PB77", "0"), "'PB77' is no pin, as PA0 or PE10 are"),
            (("pin", "PB9", "2"), "nothing does 'pin PB9 2'"),
        ):
            with pytest.raises(TargetError, match=error):
                act(*wrong)
        client.ask("POST", "/back", {"to": now_s + 0.15})  # the press is repeated
        assert led_at(now_s + 0.3) == (1, 0)


def test_pins_of_a_sensor_are_connected(app: str) -> None:
    with (
        open_device("cubestar", firmware=app) as star,
        pytest.raises(ValueError, match=r"^the pins of cubestar are not free; use a bare part$"),
    ):
        star.pins["PA0"]


WRONG = {
    "--scene sky.toml": "efm32gg has no camera; leave the scene sky.toml out",
    "--engine python": "efm32gg has no FPGA: leave --engine python out",
    "--serial uart0@PE0": "such as uart0@PE0,PE1:./tty",
    "--stimulus none.vcd": "none.vcd",
    "--semihosting-root none": "semihosting root 'none' is not a folder; create it",
    "--layout 2": "--layout is an option of cubestar, not of efm32gg",
}


@pytest.mark.parametrize("words", WRONG)
def test_wrong_calls_are_one_line(words: str, app: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert fast(app, *words.split(), "--tcp", "0") in (1, 2)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("cubestack emulate: ")
    assert WRONG[words] in line


HOST = """
import os, sys, tty
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
tty.setraw(port)
os.write(port, b"?")
sys.exit(3 if os.read(port, 1) == b"o" else 4)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux only")
def test_host_program_talks_to_the_firmware(app: str) -> None:
    words = ["--serial", "efm32gg", "--firmware", app, "--quiet"]
    assert main(["run", *words, "--", sys.executable, "-c", HOST, "{port}"]) == 3


def test_needs_firmware(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["emulate", "efm32gg"]) == 2
    assert "no program of its own; give yours with --firmware" in capsys.readouterr().err


def test_processor_tables_are_exported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "efm32gg", "--format", "svd"]) == 0
    assert main(["registers", "efm32gg", "--processor"]) == 0
    assert main(["export", "efm32gg", "--format", "c"]) == main(["registers", "efm32gg"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "cubestack export: efm32gg has no messages; choose processor-c or svd",
        "cubestack registers: efm32gg has no messages; add --processor",
    ]
