"""`hdl board check` and `--engine board:PORT` on a board behind a pseudo-terminal."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from tests.emulator.rtl.devboard.boards import behind_pty, model

from ....conftest import Run


@pytest.fixture
def port() -> Iterator[str]:
    with behind_pty(model(cubestar_wiring()).receive) as path:
        yield path


def test_good_board_has_no_difference(port: str, run: Run) -> None:
    outcome = run("hdl", "board", "check", port, "--device", "cubestar", "--frames=0", "--steps=12")
    assert (outcome.code, outcome.out) == (0, "no difference in 12 steps\n")
    assert "frames, 0 repeated" in outcome.err


def test_first_difference_is_shown_with_its_pins(run: Run, tmp_path: Path) -> None:
    board = model(cubestar_wiring())
    get = board.design.get
    board.design.get = lambda name: get(name) ^ (name == "SRAM_OE_N")  # type: ignore[method-assign]
    call = ["--device", "cubestar", "--frames=0", "--steps=12", "--out", tmp_path]
    with behind_pty(board.receive) as port:
        outcome = run("hdl", "board", "check", port, *call)
        listed = json.loads(run("hdl", "board", "check", port, *call, "--json", "--force").out)
    assert outcome.code == 1
    assert "first difference in step 1, " in outcome.out
    assert "SRAM_OE_N is 0 on the board, not 1" in outcome.out
    assert any("SRAM_OE_N" in line and "differs" in line for line in outcome.out.splitlines())
    assert (listed["equal"], listed["repeated"]) == (False, True)
    shown = run("hdl", "wave", tmp_path / "board-check.vcd", "--text").out
    assert "EMU_SRAM_OE_N" in shown


@pytest.mark.parametrize(
    ("command", "code", "text"),
    [
        ("hdl board check /dev/none --device cubestar", 1, "there is no port /dev/none"),
        ("hdl board check a,b,c --device cubestar", 2, "names 3 ports"),
        ("emulate cubestar --engine board:/dev/none", 1, "there is no port /dev/none"),
        ("measure cubestar --engine board:", 2, "names no board; the form is board:PORT"),
        ("measure cubestar --engine boards", 2, "is no engine; choose from auto, compiled, exact"),
        ("emulate aramis --engine board:/dev/none", 2, "has no FPGA"),
    ],
)
def test_wrong_call_is_one_line(command: str, code: int, text: str, run: Run) -> None:
    outcome = run(*command.split())
    assert (outcome.code, outcome.err.count("\n")) == (code, 1)
    assert text in outcome.err


def test_board_with_another_design_names_both(port: str, run: Run) -> None:
    outcome = run("emulate", "cubesense", "--engine", f"board:{port}")
    assert (outcome.code, outcome.err.count("\n")) == (1, 1)
    assert "has the top top (design" in outcome.err
    assert "needs CubeSensePair (design" in outcome.err


def test_cable_that_is_pulled_ends_the_run_in_order(run: Run, tmp_path: Path) -> None:
    board, requests = model(cubestar_wiring()), iter(range(60))

    def receive(data: bytes) -> bytes:
        if next(requests, None) is None:
            raise OSError
        return board.receive(data)

    with behind_pty(receive) as port:
        outcome = run("measure", "cubestar", "--frames", 1, "--engine", f"board:{port}", "--json")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err == (
        f"cubestack measure: the connection to the board on {port} was lost; check cable and"
        " power\n"
    )
