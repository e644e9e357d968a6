"""Switches of a firmware: where it can do what its documents print, or better.

A sensor declares its switches as one dataclass, whose fields `switch` makes. A profile sets them
all: `published` runs the algorithms as the documents print them, with their failures, and
`extended` the best that is known. Single switches can differ from the profile.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal, Self, get_args

Profile = Literal["published", "extended"]
PROFILES: tuple[Profile, ...] = get_args(Profile)
DEFAULT_PROFILE: Profile = "published"

#: What switches are that are of no one profile.
MIXED = "mixed"


@dataclass(frozen=True)
class Switch:
    """What is declared of a switch, in the metadata of its field.

    Attributes:
        meaning: one phrase: what it decides.
        published: value as the documents have it.
        extended: the better one.
        source: document and section.
        reason: why there is another value.
        choices: all values, as typed.
        hardware: whether it is a matter of the built board, so that no telecommand can change it.
    """

    meaning: str
    published: str
    extended: str
    source: str
    reason: str
    choices: tuple[str, ...]
    hardware: bool = False


def switch(
    meaning: str,
    published: str,
    extended: str,
    *others: str,
    source: str,
    reason: str,
    hardware: bool = False,
) -> Any:
    """A field for a switch, whose default is that of the default profile."""
    choices = tuple(dict.fromkeys((published, extended, *others)))
    declared = Switch(meaning, published, extended, source, reason, choices, hardware)
    return field(default=getattr(declared, DEFAULT_PROFILE), metadata={"switch": declared})


@dataclass(frozen=True)
class Switches:
    """Base of a sensor's switches; by itself, of a sensor that has none."""

    def __post_init__(self) -> None:
        """Refuse values that a switch does not have: ValueError."""
        for name, declared in self.declared().items():
            if (value := getattr(self, name)) not in declared.choices:
                known = ", ".join(declared.choices)
                raise ValueError(f"switch {name} must be one of {known}, not {value!r}")

    @classmethod
    def declared(cls) -> Mapping[str, Switch]:
        """All of them by name."""
        return {one.name: one.metadata["switch"] for one in fields(cls)}

    @classmethod
    def of(cls, profile: str = DEFAULT_PROFILE, changes: str = "") -> Self:
        """Those of a profile, but for ``changes``: `SWITCH=VALUE`, with commas between several.

        ValueError names the profile, switch or value that there is not.
        """
        if profile not in PROFILES:
            raise ValueError(f"profile must be one of {', '.join(PROFILES)}, not {profile!r}")
        declared = cls.declared()
        values = {name: getattr(one, profile) for name, one in declared.items()}
        for change in filter(None, changes.split(",")):
            name, equals, value = change.partition("=")
            if not equals or name not in declared:
                known = ", ".join(declared) or "none"
                wrong = f"no switch {name!r}" if equals else f"{change!r} is not SWITCH=VALUE"
                raise ValueError(f"set: {wrong}; switches: {known}")
            values[name] = value
        return cls(**values)

    def beside(self, profile: str) -> dict[str, str]:
        """Those that differ from a profile, by name."""
        plain = type(self).of(profile)
        return {
            name: value
            for name in self.declared()
            if (value := getattr(self, name)) != getattr(plain, name)
        }

    @property
    def profile(self) -> str:
        """The profile that these are; ``MIXED`` where single ones differ."""
        return next((one for one in PROFILES if self == type(self).of(one)), MIXED)
