"""The table of faults for readers: docs/faults.md holds this text."""

from cubestack.emulator.faults.declaration import Fault, Parameter
from cubestack.emulator.faults.table import FAULTS

HEAD = ("kind", "hits a", "what it does", "parameters, with range and default")


def markdown_table() -> str:
    """Every fault with its parameters, as a Markdown table."""
    rows = [HEAD, ("---",) * len(HEAD)]
    for kind, fault in FAULTS.items():
        rows.append((f"`{kind}`", fault.site.value, fault.effect(), _parameters(fault)))
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _parameters(fault: type[Fault]) -> str:
    defaults = fault()
    texts = [
        f"`{name}`: {parameter.text}, {_range(parameter)} ({_default(getattr(defaults, name))})"
        for name, parameter in fault.parameters().items()
    ]
    return "; ".join(texts) or "none"


def _range(parameter: Parameter) -> str:
    return "any text" if parameter.range == "any" else parameter.range


def _default(value: object) -> str:
    match value:
        case None:
            return "drawn"
        case bool():
            return str(value).lower()
        case float():
            return f"{value:g}"
    return str(value)
