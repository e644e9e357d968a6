"""What a fault is: a small declaration from which reader, documents and completion derive."""

import math
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, ClassVar, get_args


class FaultError(ValueError):
    """A fault, one of its parameters or its target makes no sense."""


class Site(Enum):
    """Where a fault acts; the value says what its targets are."""

    UART = "serial line"
    I2C = "I2C bus"
    ACKNOWLEDGE = "acknowledge pin of the FPGA"
    CONTROL = "control pin of the FPGA"
    CAMERA = "camera"
    MEMORY = "memory"
    FPGA = "FPGA"
    SUPPLY = "supply channel"
    PROCESSOR = "processor"
    CORE = "core of a processor with own firmware"


@dataclass(frozen=True)
class Parameter:
    """A parameter of a fault.

    Attributes:
        text: what it is.
        unit: of a number; empty for none.
        low, high: limits of a number, both allowed.
        choices: texts that it may be; None for a number, or for any text.
        drawn: it may be left out: it is then drawn from the seed.
    """

    text: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] | None = None
    drawn: bool = False

    @property
    def range(self) -> str:
        """Its range in words."""
        if self.choices is not None:
            return " or ".join(self.choices)
        if self.low == -math.inf:
            return "any"
        return f"{self.low:.10g} to {self.high:.10g} {self.unit}".rstrip()


def number(default: float, text: str, unit: str, low: float, high: float) -> Any:
    """A field that is a number from ``low`` to ``high``."""
    return field(default=default, metadata={"parameter": Parameter(text, unit, low, high)})


def place(text: str, high: float) -> Any:
    """A field that is a whole number from 0 to ``high``; left out, it is drawn from the seed."""
    return field(default=None, metadata={"parameter": Parameter(text, "", 0, high, drawn=True)})


def choice(default: str | bool | None, text: str, *choices: str) -> Any:
    """A field that is one of some texts; without choices any text, drawn when left out."""
    parameter = Parameter(text, choices=choices or None, drawn=default is None)
    return field(default=default, metadata={"parameter": parameter})


@dataclass(frozen=True)
class Fault:
    """Base of all faults.

    Attributes:
        kind: its name in a plan.
        site: what it acts on.
        momentary: it happens at one instant, so it has no duration.
    """

    kind: ClassVar[str]
    site: ClassVar[Site]
    momentary: ClassVar[bool]

    def __init_subclass__(cls, kind: str, site: Site, momentary: bool = False) -> None:
        """Declare what does not differ between two of a kind."""
        cls.kind, cls.site, cls.momentary = kind, site, momentary

    def __post_init__(self) -> None:
        """Refuse what the declaration does not allow."""
        for declared in fields(self):
            self._check(declared.name, declared.type, getattr(self, declared.name))

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """Its parameters by name."""
        return {declared.name: declared.metadata["parameter"] for declared in fields(cls)}

    @classmethod
    def effect(cls) -> str:
        """What it does, in a sentence."""
        return (cls.__doc__ or "").splitlines()[0]

    def _check(self, name: str, kind: Any, value: object) -> None:
        parameter = self.parameters()[name]
        if value is None and parameter.drawn:
            return
        types = get_args(kind) or (kind,)
        whole = int in types
        if str in types:
            if isinstance(value, str) and (not parameter.choices or value in parameter.choices):
                return
        elif bool in types:
            if isinstance(value, bool):
                return
        elif (
            isinstance(value, int if whole else int | float)
            and not isinstance(value, bool)
            and parameter.low <= value <= parameter.high
        ):
            return
        of = " a whole number" if whole else ""
        raise FaultError(f"{self.kind}: {name} must be{of} {parameter.range}, not {value!r}")
