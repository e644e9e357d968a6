"""What a command loads: nothing that only another device or another use of a device needs."""

import subprocess
import sys

import pytest

from cubestack.host.cli.arguments import Parser
from cubestack.host.errors import TargetError


def loaded(code: str) -> set[str]:
    """Modules that are loaded after ``code``, also if it exits."""
    call = (
        f"import atexit, sys\natexit.register(lambda: print(*sys.modules, file=sys.stderr))\n{code}"
    )
    ended = subprocess.run([sys.executable, "-P", "-c", call], capture_output=True, text=True)
    return {*ended.stderr.split()}


def test_help_of_one_device_loads_no_other_one() -> None:
    call = "from cubestack.host.cli.main import main\nmain(['measure', 'aramis', '--help'])"
    found = loaded(call)
    assert "cubestack.host.experiments.aramis.measure" in found
    assert not {"cubestack.host.sensors.cubestar", "cubestack.emulator.faults.table"} & found
    assert (
        not {f"cubestack.host.experiments.{name}.measure" for name in ("cubestar", "cubesense")}
        & found
    )


@pytest.mark.parametrize(
    ("board", "unused"),
    [
        ("aramis", {"amaranth", "PIL", "elftools", "cubestack.emulator.iss.binding"}),
        ("cubestar", {"PIL", "elftools", "cubestack.emulator.iss.binding", "cubestack.hdl.user"}),
        ("cubesense", {"PIL", "elftools", "cubestack.emulator.iss.binding", "cubestack.hdl.user"}),
    ],
)
def test_board_loads_no_simulator_pictures_or_foreign_gateware(
    board: str, unused: set[str]
) -> None:
    module = f"cubestack.emulator.boards.{board}.board"
    found = loaded(f"import {module}")
    assert module in found
    assert not unused & found


def test_parser_declares_when_it_parses_and_fails_alone() -> None:
    def fail(_parser: Parser) -> None:
        raise TargetError("it is broken")

    made: list[str] = []
    parser = Parser(prog="all")
    commands = parser.add_subparsers(dest="command")
    commands.add_parser("sound", declare=lambda one: made.append(one.prog))
    commands.add_parser("broken", declare=fail)
    assert parser.parse_args(["sound"]).command == "sound"
    assert made == ["all sound"]
    with pytest.raises(SystemExit) as ended:
        parser.parse_args(["broken", "--any"])
    assert ended.value.code == 2
    assert parser.all_declared() is parser  # whatever is broken
    assert made == ["all sound"]  # once


def test_collector_runs_again_after_loading_and_leaves_out_what_was_loaded() -> None:
    code = (
        "import gc, sys\n"
        "from cubestack.host.cli.main import main\n"
        "sys.argv[1:] = ['registers', 'cubestar']\n"
        "assert main() == 0 and gc.isenabled() and gc.get_freeze_count() > 10_000\n"
    )
    subprocess.run([sys.executable, "-P", "-c", code], check=True, stdout=subprocess.DEVNULL)
