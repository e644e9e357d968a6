import random
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cubestack.emulator.faults import table
from cubestack.emulator.faults.declaration import FaultError
from cubestack.emulator.faults.plan import PlannedFault, load_plan, parse_plan
from tests.together import together

PLAN = """
seed = 7
[[fault]]
kind = "uart-drop"
at_s = 2
for_s = 0.5
rate = 0.25
[[fault]]
kind = "latch-up"
target = "memory"
lasting = true
[[fault]]
kind = "ack-lost"
"""


def test_fault_plan_is_loaded_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    plan = load_plan(path)
    assert (plan.seed, plan.name) == (7, str(path))
    assert plan.faults == (
        PlannedFault(table.UartDrop(rate=0.25), None, 2, 0.5),
        PlannedFault(table.LatchUp(lasting=True), "memory"),
        PlannedFault(table.AckLost()),
    )
    assert parse_plan("").faults == ()


@pytest.mark.filterwarnings("default::FutureWarning")
def test_deprecated_plan_time_keys_still_work_with_a_warning(
    recwarn: pytest.WarningsRecorder,
) -> None:
    old = PLAN.replace("at_s", "at").replace("for_s", "for")
    assert parse_plan(old) == parse_plan(PLAN)
    assert [str(one.message) for one in recwarn] == [
        f"the key {old} is deprecated and goes with the next version: write {old}_s"
        for old in ("at", "for")
    ]
    with pytest.raises(FaultError, match="fault 1: at_s is given twice, once as at"):
        parse_plan('[[fault]]\nkind = "ack-lost"\nat_s = 1\nat = 1')


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seed = -1", "seed must be at least 0, not -1"),
        ("speed = 1", "unknown key 'speed'; a plan has seed and"),
        ("fault = 3", r"fault must be an array of tables, \[\[fault\]\]"),
        ("seed = ", "plan is not a TOML file: "),
        ("[[fault]]", "fault 1: needs the key kind"),
        ('[[fault]]\nkind = "ack-lost"\n[[fault]]\nkind = 3', "fault 2: kind must be text"),
        ('[[fault]]\nkind = "smoke"', "fault 1: unknown fault 'smoke'; known: uart-drop"),
        ('[[fault]]\nkind = "uart-drop"\nat_s = "noon"', "at_s must be a number, not 'noon'"),
        ('[[fault]]\nkind = "uart-drop"\nrate = 7', "uart-drop: rate must be 0 to 1, not 7"),
        ('[[fault]]\nkind = "ack-lost"\nrate = 1', "unknown parameter 'rate'; known: none"),
    ],
)
def test_rejects_invalid_plans_naming_the_place(text: str, message: str) -> None:
    with pytest.raises(FaultError, match=message):
        parse_plan(text)


def test_reports_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FaultError, match=r"none\.toml: No such file"):
        load_plan(tmp_path / "none.toml")
    (tmp_path / "noise").write_bytes(b"\xff\xfe")
    with pytest.raises(FaultError, match="not UTF-8 text"):
        load_plan(tmp_path / "noise")


def test_damaged_plans_raise_only_plan_errors() -> None:
    generator = random.Random(5)
    for _ in range(2000):
        text = list(PLAN)
        for _ in range(generator.randrange(1, 6)):
            text[generator.randrange(len(text))] = chr(generator.randrange(10, 127))
        with suppress(FaultError):
            parse_plan("".join(text))


DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "fault-kinds.md"


@together("kind", table.FAULTS)
def test_every_fault_has_a_kind_defaults_and_a_description(kind: str) -> None:
    fault = table.FAULTS[kind]
    assert fault.kind == kind
    assert fault.effect().endswith(".")
    assert fault() == table.make_fault(kind)  # every parameter has a default
    assert vars(table)[fault.__name__] is fault
    assert fault.__doc__ != "Base of all faults."


@example("kind", 1)
@given(st.text(max_size=8), st.one_of(st.none(), st.text(), st.integers(), st.floats()))
def test_any_value_raises_at_most_a_fault_error(name: str, value: object) -> None:
    for kind, fault in table.FAULTS.items():
        for known in (name, *fault.declared()):
            with suppress(FaultError):
                table.make_fault(kind, **{known: value})


def test_the_document_has_the_table_as_declared_and_a_reaction_to_every_fault() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    assert table.markdown_table() in text
    reactions = text.split("## What the firmware does about it")[1]
    for kind in table.FAULTS:
        assert f"| `{kind}` |" in reactions
