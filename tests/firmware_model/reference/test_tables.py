import math
import re
from itertools import pairwise
from pathlib import Path

import pytest

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.reference import tables


@pytest.mark.parametrize(
    ("allowed", "expected"),
    [
        ({0, 1, 2, 5, 9}, [(0, 2), (5, 5), (9, 9)]),
        (set(), []),
        ({*range(10)}, [(0, 9)]),
        ({1, 3}, [(1, 1), (3, 3)]),
    ],
)
def test_consecutive_values_form_range(allowed: set[int], expected: list[tuple[int, int]]) -> None:
    assert tables._ranges(9, lambda raw: raw in allowed) == expected


def test_dependent_field_ranges_cover_all_values() -> None:
    """Of the other field, one behind the other, each with what the table allows."""
    message = INTERFACE.telecommand("ImageBlockSet")
    field = message.field("BlockNumber")
    groups = list(tables._allowed(message, field))
    assert groups[0][1] == 0
    assert groups[-1][2] == 255
    assert all(next_[1] == one[2] + 1 for one, next_ in pairwise(groups))
    for place, low, high, ranges in groups:
        assert place == message.field("BlockSize").bit_offset // 8
        for size in (low, high):
            for number in (0, 2047, 2048, 4095, 4096, 8191, 8192, 16383, 16384, 65535):
                allowed = field.allows(number, {"BlockSize": size})
                assert any(a <= number <= b for a, b in ranges) == allowed, (size, number)


def test_reference_tables_write_limits_as_c_literals() -> None:
    bounds = [tables._bound(limit) for limit in (-math.inf, math.inf, 5, 0.1)]
    assert bounds == ["-INFINITY", "INFINITY", "5.0f", "0.1f"]


def test_reference_tables_have_no_rule_for_unlimited_fields() -> None:
    ranges: list[str] = []
    assert list(tables._rules(INTERFACE.telecommand("Exposure"), ranges)) == []
    (rule,) = tables._rules(INTERFACE.telecommand("WriteTo_IS_Register"), ranges)
    assert rule.startswith("{RULE_U8, 1, 0, 0, 255, FLAG_ISSetupError,")  # DataH, alone
    assert ranges == ["    {0, 0},"]


def test_ordered_fields_have_a_reference_rule_with_size_and_offsets() -> None:
    ordered = 0
    for message in INTERFACE.telecommands:
        if not message.ordered:
            continue  # of lists of allowed values, rules take long
        rules = [rule for rule in tables._rules(message, []) if rule.startswith("{RULE_ORDER")]
        for rule, pair in zip(rules, message.ordered, strict=True):
            places = [message.field(name).bit_offset // 8 for name in pair]
            assert rule.startswith(f"{{RULE_ORDER_U{message.field(pair[0]).bits},")
            assert list(map(int, re.findall(r" (\d+),", rule)))[:2] == places
            ordered += 1
    assert ordered == 3  # a region along both axes, and the sizes of an area


def test_reference_rules_point_to_their_rows_of_the_range_table(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Rules of a list point at the rows of one table, one behind the other up to its end."""
    monkeypatch.setattr(tables, "_ranges", lambda last, _allowed: [(0, 5), (7, last)])
    text = tables.source()
    table = text.split("static const struct range ranges[] = {\n")[1].split("};")[0]
    rows = re.findall(r"\{(\d+), (\d+)\},\n", table)
    lists = re.findall(r"\{ranges \+ (\d+), (\d+)\}", text)
    assert [int(first) for first, _ in lists] == [*range(0, 2 * len(lists), 2)]
    assert {count for _, count in lists} == {"2"}
    assert lists
    assert rows[::2] == [("0", "5")] * len(lists)
    assert {low for low, _ in rows[1::2]} == {"7"}
    assert len(rows) == 2 * len(lists)


def test_creates_named_output_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "header", lambda: "the header")  # all of them take a second
    monkeypatch.setattr(tables, "source", lambda: "the source")
    folder = tmp_path / "build" / "generated"
    tables.generate(folder)
    names = {path.name for path in folder.iterdir()}
    assert names == {"cubestar_tables.h", "cubestar_tables.c", "pins.h", "efm32gg.h"}
    assert (folder / "cubestar_tables.c").read_text() == "the source"
