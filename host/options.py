"""Options of experiments: values that are declared once, as fields of a dataclass.

The command line is generated from these declarations, and programs give the same names as keywords.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from cubestack.firmware_model.values import FLAG, DeclaredValues, ValueKind, declare, vector, whole


def _file(given: Any) -> Any:
    return Path(given) if isinstance(given, str) else given


PATH = ValueKind("path", "a path", Path, Path)
FILE = ValueKind("file", "a file", _file, Path)
"""The path of a file, or what a program made instead of it: a scene, a plan of faults."""

OUTPUT = ValueKind("output", "a file to write", Path, Path)

SWITCH = replace(FLAG, read={False: False, True: True}.__getitem__)  # 0 and 1 too

# Each takes (default, meaning), then keywords of `Declaration`.
path_option: Callable[..., Any] = partial(declare, PATH, metavar="FILE")
output_option: Callable[..., Any] = partial(declare, OUTPUT, metavar="FILE")
file_option: Callable[..., Any] = partial(declare, FILE, metavar="FILE")
corner: Callable[..., Any] = partial(vector, 2, kind=whole, metavar="X,Y")
switch: Callable[..., Any] = partial(declare, SWITCH, False)


def option_string(name: str) -> str:
    """An option's name as the command line has it."""
    return "--" + name.replace("_", "-")


@dataclass(frozen=True, kw_only=True)
class Options(DeclaredValues):
    """Base of all options; each value is checked, and made of text where it is one.

    Raises ValueError for a value that can not be, and for options that do not go together.
    """

    def __post_init__(self) -> None:
        groups: dict[str, str] = {}
        for name, one in self.declared().items():
            if not self.given(name):
                continue
            try:
                object.__setattr__(self, name, one.take(getattr(self, name)))
            except ValueError as error:
                raise self.refusal(name, str(error)) from None
            if (other := groups.setdefault(one.group or name, name)) != name:
                both = f"{option_string(other)} and {option_string(name)}"
                raise ValueError(f"{both} exclude each other")
        self.check()

    def check(self) -> None:
        """Refuse options that do not go together, with a ValueError."""

    def given(self, *names: str) -> bool:
        """Whether any of these options differs from its default."""
        return any(getattr(self, name) != self.declared()[name].default for name in names)
