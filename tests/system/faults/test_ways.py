import json
import math
from collections.abc import Iterator
from typing import Any

import pytest

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.faults.declaration import FaultError
from cubestack.emulator.faults.plan import parse_plan
from cubestack.emulator.faults.table import FAULTS
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.cli.main import main
from cubestack.host.emulation.emulated import open_device
from cubestack.host.shell.language import Shell
from cubestack.host.targets import open_target
from tests.system.conftest import Ear
from tests.tiers import quick

from .bench import BENCHES, Bench, Star, Tracker, powered


def given(kind: str, board: Board) -> dict[str, Any]:
    """A value for each parameter of a fault; rates are too low to have an effect."""
    fault = FAULTS[kind]
    values = {name: getattr(fault(), name) for name in fault.declared()}
    for name in (name for name, default in values.items() if default is None):
        values[name] = next(iter(board.engine.registers)) if name == "register" else 0
    return values | ({"rate": 1e-9} if "upsets" in kind else {})


def in_words(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


# --- shell ----------------------------------------------------------------------------------------


@pytest.fixture(params=BENCHES)
def shell(request: pytest.FixtureRequest) -> Iterator[Shell]:
    target = open_target(f"emulated:{request.param}", seed=1)
    yield Shell(target)
    target.close()


def test_shell_completes_and_injects_every_kind(shell: Shell) -> None:
    board: Board = shell.target.controls._board  # type: ignore[union-attr]
    kinds = board.faults.kinds()
    completed = set(shell.complete("fault "))
    assert {*kinds, "clear"} <= completed
    assert not {kind for kind in FAULTS if not board.faults.targets(FAULTS[kind].site)} & completed
    for kind, targets in kinds.items():
        assert kind in shell.complete(f"fault {kind[:-1]}")
        assert shell.complete(f"fault {kind} ")[: len(targets)] == list(targets)
        values = given(kind, board).items()
        words = " ".join(f"{name}={in_words(value)}" for name, value in values)
        again = "" if FAULTS[kind].momentary else " for_s=0.001"
        lines = [f"{target}{more}" for target in targets for more in ("", f" {words}")]
        for line in (*lines, f"at_s=0.01{again}"):
            assert shell.execute(f"fault {kind} {line}") is not None
    lasting = {kind for kind in kinds if not FAULTS[kind].momentary}
    assert {injection.fault.kind for injection in board.faults._running} >= lasting
    assert shell.execute("fault clear") is not None
    assert board.faults._running == []


@pytest.mark.parametrize("device", BENCHES)
def test_command_line_injects_every_kind(device: str, capsys: pytest.CaptureFixture[str]) -> None:
    with powered(device) as bench:
        faults = [f"{kind} {targets[-1]}" for kind, targets in bench.faults.kinds().items()]
    commands = "; ".join(f"fault {fault}; fault clear" for fault in faults)
    assert main(["shell", f"emulated:{device}", "-c", commands]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[::2] == [f"fault: {fault}" for fault in faults]


# --- plans ----------------------------------------------------------------------------------------


def plan(seed: int, entries: list[dict[str, Any]]) -> str:
    lines = [f"seed = {seed}"]
    for entry in entries:
        lines += ["[[fault]]", *(f"{key} = {json.dumps(value)}" for key, value in entry.items())]
    return "\n".join(lines)


def test_plan_injects_every_kind(bench: Bench) -> None:
    entries = [
        {"kind": kind, "target": target, "at_s": 0.5}
        | ({} if FAULTS[kind].momentary else {"for_s": 0.25})
        | given(kind, bench.board)
        for kind, targets in bench.faults.kinds().items()
        for target in targets
    ]
    injections = bench.faults.load(parse_plan(plan(3, entries)))
    assert len(injections) == len(entries)
    for injection in injections:
        values = given(injection.fault.kind, bench.board)
        assert {name: getattr(injection.fault, name) for name in values} == values
        assert injection.start_ps == 500 * 10**9
        assert injection.end_ps in (None, 750 * 10**9)
    bench.board.kernel.advance_to(10**12)
    assert bench.faults._running == []


# --- from the seed --------------------------------------------------------------------------------

STEP_S = {"cubestar": 2.0, "cubesense": 0.4, "aramis": 0.6}  # longer than a picture takes
NADIR_HALF = ("nadir", "NADACK", "NADEN", "SRAM2")  # targets of the half that measures

RATES = dict.fromkeys(("uart-drop", "uart-corrupt", "uart-delay"), 0.003)
RATES |= {"i2c-nack": 0.2, "i2c-stretch": 0.2, "memory-upsets": 1e-6, "register-upsets": 0.5}


def all_kinds(bench: Bench) -> tuple[list[dict[str, Any]], float]:
    """A plan of every kind and its end: memory and wire faults throughout, others in turn."""
    entries, at_s = [], 0.2
    for kind, targets in bench.faults.kinds().items():
        target = next((name for name in NADIR_HALF if name in targets), targets[0])
        entry: dict[str, Any] = {"kind": kind, "target": target}
        if kind in RATES:
            entry["rate"] = RATES[kind]
        elif not kind.startswith(("memory", "register")):
            entry["at_s"] = at_s
            at_s += STEP_S[bench.name]
            if not FAULTS[kind].momentary:
                entry["for_s"] = 0.9 * STEP_S[bench.name]
        entries.append(entry)
    return entries, at_s


def played(device: str, seed: int, until_s: float = math.inf) -> tuple[Any, list[str], set[str]]:
    """All bytes with their times, the log, and the kinds of the plan."""
    with powered(device) as bench:
        entries, end_s = all_kinds(bench)
        bench.faults.load(parse_plan(plan(seed, entries)))
        ears = [vars(Ear(uart)) for uart in bench.board.uarts.values()]
        bench.plug_in(timeout_s=0.2, retries=1)
        found: list[tuple[float, str]] = []
        while bench.now_s < min(end_s, until_s):
            for act in (bench.measure, bench.ask_i2c):
                try:
                    answer = repr(act())
                except OSError as error:
                    answer = str(error)
                found.append((bench.now_s, answer))
        return (found, ears), [str(event) for event in bench.faults.log], set(bench.faults.kinds())


@pytest.mark.parametrize("device", quick(BENCHES, 1))
def test_plan_of_every_kind_is_reproducible(device: str) -> None:
    first = played(device, 8)
    _, log, kinds = first
    assert {line.split()[2] for line in log} == kinds
    times = [float(line.split()[0]) for line in log]
    assert 0 <= min(times) < max(times)
    assert played(device, 8) == first
    other = played(device, 7, 1.0)[1]
    assert other != log[: len(other)]


# --- what makes no sense --------------------------------------------------------------------------


def test_rejected_faults_name_the_accepted_values(star: Star) -> None:
    cases: list[tuple[dict[str, Any], str]] = [
        ({"fault": "pixel-hat"}, "unknown fault 'pixel-hat'; known: uart-drop"),
        ({"fault": "pixel-hot", "target": "sun"}, "unknown camera 'sun'; known: imager"),
        ({"fault": "uart-drop", "rate": 2.0}, "rate must be 0 to 1, not 2.0"),
        ({"fault": "uart-drop", "chance": 1}, "unknown parameter 'chance'; known: rate, direction"),
        ({"fault": "latch-up", "for_s": 1.0}, "omit for_s"),
        ({"fault": "uart-drop", "at_s": -1.0}, "at_s must be 0.*s, not -1.0"),
        ({"fault": "register-flip", "register": "writer.ack", "bit": 3}, r"writer\.ack\[3\]"),
    ]
    for arguments, message in cases:
        with pytest.raises(ValueError, match=message):
            star.faults.inject(**arguments)
    assert issubclass(FaultError, ValueError)
    assert star.measure() == "CALCULATED"
    assert star.faults.events == 0


def test_register_faults_need_the_compiled_engine() -> None:
    with open_device("cubestar", SkyScene.pointing(84, -1), engine="python") as session:
        kinds = session.board.faults.kinds()
        others = {"core-flip", "core-upsets", "fpga-dead"}  # own firmware; several FPGAs
        assert set(FAULTS) - set(kinds) - others == {"register-flip", "register-upsets"}
        with pytest.raises(ValueError, match="only the compiled engine"):
            session.board.faults.inject("register-upsets")


def test_faults_without_a_target_are_rejected(tracker: Tracker) -> None:
    missing = set(FAULTS) - set(tracker.faults.kinds())
    assert len(missing) > 10
    for kind in missing:
        with pytest.raises(FaultError, match=rf"^{kind}: "):
            tracker.inject(kind)
