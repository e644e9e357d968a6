"""Renders a sensor's switches: text table, Markdown, JSON."""

import json
import textwrap

from cubestack.firmware_model.interface.codec.switches import Switches
from cubestack.host.export.field_text import picked

FIELDS = ("meaning", "published", "extended", "source", "reason", "choices", "hardware")


def render_switches(title: str, switches: type[Switches], format_name: str) -> str:
    """The switches of the sensor called ``title``."""
    declared = switches.declared()
    if format_name == "json":
        shown = {name: picked(one, *FIELDS) for name, one in declared.items()}
        return json.dumps(shown, indent=2) + "\n"
    if format_name == "table":
        return (
            "".join(
                f"{name}: {one.meaning}\n"
                f"  published  {one.published} ({one.source})\n"
                f"  extended   {one.extended}\n"
                + "".join(f"  or         {other}\n" for other in one.choices[2:])
                + textwrap.fill(one.reason, 96, initial_indent="  ", subsequent_indent="  ")
                + "\n"
                for name, one in declared.items()
            )
            or f"{title} has no switches\n"
        )
    rows = [
        f"| `{name}` | {one.meaning} | `{one.published}` | "
        f"{', '.join(f'`{value}`' for value in one.choices[1:])} | {one.source} | {one.reason} |"
        for name, one in declared.items()
    ]
    head = [
        "| switch | what it decides | published | extended (others) | source | reason |",
        "|---|---|---|---|---|---|",
    ]
    return "\n".join([*head, *rows]) + "\n"
