"""Every kind from the shell, from a plan and from a test; logged; the same again from its seed."""

import math
from collections.abc import Iterator
from typing import Any

import pytest

from cubestack.emulator.faults.declaration import Fault, FaultError, Parameter
from cubestack.emulator.faults.plan import parse_plan
from cubestack.emulator.faults.table import FAULTS
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.cli.main import main
from cubestack.host.devices.emulated import open_device
from cubestack.host.devices.targets import open_target
from cubestack.host.shell.language import Shell
from tests.system.conftest import Ear

from .bench import BENCHES, Bench


def given(fault: type[Fault], registers: dict[str, int]) -> dict[str, Any]:
    """A value for each parameter of a fault; the rates are those that no run takes notice of."""
    values = {}
    for name, parameter in fault.parameters().items():
        default = getattr(fault(), name)
        values[name] = _value(name, parameter, registers) if default is None else default
    return values | ({"rate": 1e-9} if "upsets" in fault.kind else {})


def _value(name: str, parameter: Parameter, registers: dict[str, int]) -> Any:
    return next(iter(registers)) if name == "register" else round(min(parameter.high, 0))


def registers_of(board: Any) -> dict[str, int]:
    engine = getattr(board, "engine", None)
    return {} if engine is None else dict(engine.registers)


def in_words(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


# --- shell ----------------------------------------------------------------------------------------


@pytest.fixture(params=BENCHES)
def shell(request: pytest.FixtureRequest) -> Iterator[Shell]:
    target = open_target(f"emulated:{request.param}", seed=1)
    yield Shell(target)
    target.close()


def test_the_shell_completes_and_takes_every_kind(shell: Shell) -> None:
    board: Any = shell.target.controls._board  # type: ignore[union-attr]
    kinds = board.faults.kinds()
    completed = shell.complete("fault ")
    assert set(kinds) | {"clear"} <= set(completed)
    absent = {kind for kind, fault in FAULTS.items() if not board.faults.targets(fault.site)}
    assert not absent & set(completed)
    for kind, targets in kinds.items():
        assert kind in shell.complete(f"fault {kind[:-1]}")
        assert shell.complete(f"fault {kind} ")[: len(targets)] == list(targets)
        words = [f"{n}={in_words(v)}" for n, v in given(FAULTS[kind], registers_of(board)).items()]
        for target in targets:
            for line in (f"fault {kind} {target}", f"fault {kind} {target} {' '.join(words)}"):
                assert shell.execute(line) is not None
        again = "" if FAULTS[kind].momentary else " for_s=0.001"
        assert shell.execute(f"fault {kind} at_s=0.01{again}") is not None
    lasting = {kind for kind in kinds if not FAULTS[kind].momentary}
    assert {injection.fault.kind for injection in board.faults._running} >= lasting
    assert shell.execute("fault clear") is not None
    assert board.faults._running == []


@pytest.mark.parametrize("device", BENCHES)
def test_the_command_line_takes_every_kind(device: str, capsys: pytest.CaptureFixture[str]) -> None:
    with BENCHES[device]() as bench:
        kinds = bench.faults.kinds()
    commands = [f"fault {kind} {targets[-1]}; fault clear" for kind, targets in kinds.items()]
    assert main(["shell", f"emulated:{device}", "-c", "; ".join(commands)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[::2] == [f"fault: {kind} {targets[-1]}" for kind, targets in kinds.items()]


# --- plans ----------------------------------------------------------------------------------------


def test_a_plan_takes_every_kind(bench: Bench) -> None:
    kinds = bench.faults.kinds()
    entries = []
    for kind, targets in kinds.items():
        for target in targets:
            values = given(FAULTS[kind], registers_of(bench.board))
            lines = [f'kind = "{kind}"', f'target = "{target}"', "at = 0.5"]
            lines += [] if FAULTS[kind].momentary else ["for = 0.25"]
            lines += [
                f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {in_words(value)}"
                for name, value in values.items()
            ]
            entries.append("[[fault]]\n" + "\n".join(lines))
    injections = bench.faults.load(parse_plan("seed = 3\n" + "\n".join(entries)))
    assert len(injections) == len(entries)
    for injection in injections:
        values = given(FAULTS[injection.fault.kind], registers_of(bench.board))
        assert all(getattr(injection.fault, name) == value for name, value in values.items())
        assert injection.start_ps == 500 * 10**9
        assert injection.end_ps in (None, 750 * 10**9)
    bench.board.kernel.advance_to(10**12)
    assert bench.faults._running == []


# --- from the seed --------------------------------------------------------------------------------

STEP_S = {"cubestar": 1.6, "cubesense": 0.4, "aramis": 0.6}
"""Longer than a picture takes."""

NADIR_HALF = ("nadir", "NADACK", "NADEN", "SRAM2")
"""Targets of the half that measures."""

RATES = {
    "uart-drop": 0.003,
    "uart-corrupt": 0.003,
    "uart-delay": 0.003,
    "i2c-nack": 0.2,
    "i2c-stretch": 0.2,
    "memory-upsets": 1e-6,
    "register-upsets": 0.5,
}


def all_kinds(bench: Bench) -> tuple[str, float]:
    """A plan of every kind: those of the wires all the time, the others one after the other."""
    entries, at_s = [], 0.2
    for kind, targets in bench.faults.kinds().items():
        target = next((name for name in NADIR_HALF if name in targets), targets[0])
        lines = [f'kind = "{kind}"', f'target = "{target}"']
        if kind in RATES:
            lines.append(f"rate = {RATES[kind]}")
        if not kind.startswith(("uart", "i2c-n", "i2c-str", "mem", "reg")):
            lines.append(f"at = {at_s}")
            lines += [] if FAULTS[kind].momentary else [f"for = {0.9 * STEP_S[bench.name]}"]
            at_s += STEP_S[bench.name]
        entries.append("[[fault]]\n" + "\n".join(lines))
    return "\n".join(entries), at_s


def played(
    device: str, seed: int, until_s: float = math.inf
) -> tuple[list[Any], list[str], set[str]]:
    """All bytes with their times, the log, and the kinds of the plan."""
    trace: list[Any] = []

    class Tap(Ear):
        def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
            trace.append((bytes(data), first_ps))

        def device_heard(self, byte: int, start_ps: int) -> None:
            trace.append((byte, start_ps))

        def framing_error(self, time_ps: int) -> None:
            trace.append(time_ps)

    with BENCHES[device]() as bench:
        text, end_s = all_kinds(bench)
        bench.faults.load(parse_plan(f"seed = {seed}\n{text}"))
        uarts = {"cubesense": (bench.board.uart, getattr(bench.board, "bench_uart", None))}
        for uart in uarts.get(device, (bench.board.uart,)):
            Tap(uart)
        bench.plug_in(timeout_s=0.2, retries=1)
        picture = {
            "cubestar": lambda: bench.device.capture_and_process(),
            "cubesense": lambda: bench.device.capture_and_detect(Camera.NADIR),
            "aramis": lambda: bench.device.measure(),
        }[device]
        while bench.now_s < min(end_s, until_s):
            for act in (picture, bench.ask_i2c):
                try:
                    trace.append((bench.now_s, repr(act())))
                except OSError as error:
                    trace.append((bench.now_s, str(error)))
        return trace, [str(event) for event in bench.faults.log], set(bench.faults.kinds())


@pytest.mark.parametrize("device", BENCHES)
def test_a_plan_of_every_kind_repeats_to_the_byte(device: str) -> None:
    first = played(device, 7)
    _, log, kinds = first
    assert {line.split()[2] for line in log} == kinds
    times = [float(line.split()[0]) for line in log]
    assert 0 <= min(times) < max(times)
    assert played(device, 7) == first
    other = played(device, 8, 1.0)[1]
    assert other != log[: len(other)]


# --- what makes no sense --------------------------------------------------------------------------


def test_refusals_name_what_would_be_right(star: Bench) -> None:
    cases: list[tuple[dict[str, Any], str]] = [
        ({"fault": "pixel-hat"}, "no fault 'pixel-hat'; there are uart-drop"),
        ({"fault": "pixel-hot", "target": "sun"}, "no camera 'sun'; there are imager"),
        ({"fault": "uart-drop", "rate": 2.0}, "rate must be 0 to 1, not 2.0"),
        ({"fault": "uart-drop", "chance": 1}, "no parameter 'chance'; it has rate, direction"),
        ({"fault": "latch-up", "for_s": 1.0}, "it has no duration"),
        ({"fault": "uart-drop", "at_s": -1.0}, "can not begin at -1 s"),
        ({"fault": "register-flip", "register": "writer.ack", "bit": 3}, r"writer\.ack\[3\]"),
    ]
    for arguments, message in cases:
        with pytest.raises(ValueError, match=message):
            star.faults.inject(**arguments)
    assert issubclass(FaultError, ValueError)
    assert star.device.capture_and_process().name == "CALCULATED"
    assert star.faults.events == 0


def test_the_simulator_s_registers_can_not_be_hit() -> None:
    with open_device("cubestar", SkyScene.pointing(84, -1), engine="python") as session:
        kinds = session.board.faults.kinds()
        assert set(FAULTS) - set(kinds) == {"register-flip", "register-upsets"}
        with pytest.raises(ValueError, match="only the compiled engine"):
            session.board.faults.inject("register-upsets")


def test_what_a_device_does_not_have_can_not_be_hit(tracker: Bench) -> None:
    missing = set(FAULTS) - set(tracker.faults.kinds())
    assert len(missing) > 10
    for kind in missing:
        with pytest.raises(FaultError, match=rf"^{kind}: "):
            tracker.inject(kind)
