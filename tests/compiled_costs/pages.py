"""Tables of compiled costs in the documentation."""

from collections.abc import Mapping
from pathlib import Path

from cubestack.firmware_model.mcu.costs import CostTable
from cubestack.host.studies.costs import rewrite_table

DOCS = Path(__file__).parents[2] / "docs"


def costs_markdown(tables: Mapping[str, CostTable]) -> str:
    """Every operation, with cycles and provenance in each table."""
    rows = [["operation", *tables]]
    for name in sorted(next(iter(tables.values())).operations):
        costs = [table.operations[name] for table in tables.values()]
        rows.append([name, *(f"{cost.cycles:,} {cost.provenance}" for cost in costs)])
    return markdown(rows)


def routines_markdown(compiled: Mapping[str, float], charged: Mapping[str, float]) -> str:
    rows = [["routine", "compiled", "charged"]]
    for name, cycles in charged.items():
        rows.append([name, f"{compiled[name]:,.0f}", f"{cycles:,.0f}"])
    return markdown(rows)


def markdown(rows: list[list[str]]) -> str:
    rows.insert(1, ["-"] * len(rows[0]))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def rewrite(page: str, tables: Mapping[str, str]) -> None:
    """Rewrite a page's tables, by the name of their marks."""
    for name, table in tables.items():
        rewrite_table(DOCS / page, name, table)


def has(page: str, table: str) -> bool:
    return table in (DOCS / page).read_text("utf-8")
