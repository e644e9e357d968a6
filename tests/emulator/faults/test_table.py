"""The declarations: every fault has all that reader, documents and completion derive from."""

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cubestack.emulator.faults import table
from cubestack.emulator.faults.declaration import FaultError
from cubestack.emulator.faults.table import FAULTS, make_fault, markdown_table

DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "fault-kinds.md"


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_is_declared_in_full(kind: str) -> None:
    fault = FAULTS[kind]
    assert fault.kind == kind
    assert fault.effect().endswith(".")
    assert fault() == make_fault(kind)  # every parameter has a default
    assert vars(table)[fault.__name__] is fault
    assert fault.__doc__ != "Base of all faults."


@example("kind", 1)
@given(st.text(max_size=8), st.one_of(st.none(), st.text(), st.integers(), st.floats()))
def test_any_value_raises_at_most_a_fault_error(name: str, value: object) -> None:
    for kind, fault in FAULTS.items():
        for known in (name, *fault.declared()):
            with suppress(FaultError):
                make_fault(kind, **{known: value})


def test_the_document_has_the_table_as_declared() -> None:
    assert markdown_table() in DOCUMENT.read_text(encoding="utf-8")


def test_the_document_has_a_reaction_to_every_fault() -> None:
    reactions = DOCUMENT.read_text(encoding="utf-8").split("## What the firmware does about it")[1]
    for kind in FAULTS:
        assert f"| `{kind}` |" in reactions
