"""Switches of a firmware: each chooses between the documents' algorithm and a better one.

A sensor declares its switches as one dataclass with `switch` fields. A profile sets all of them:
`published` runs the algorithms as the documents print them, with their failures, and `extended` the
best known ones. Single switches can differ from the profile.
"""

from dataclasses import dataclass
from typing import Any, Literal, Self, get_args

from cubestack.firmware_model.values import Declaration, DeclaredValues

Profile = Literal["published", "extended"]
PROFILES: tuple[Profile, ...] = get_args(Profile)
DEFAULT_PROFILE: Profile = "published"

#: Profile name of switches that match no profile.
MIXED = "mixed"


@dataclass(frozen=True, kw_only=True)
class Switch(Declaration):
    """Declaration of a switch."""

    published: str  #: value according to the documents
    extended: str  #: the better value
    source: str  #: document and section
    reason: str  #: why there is another value
    hardware: bool = False  #: it describes the built board, so no telecommand can change it

    @property
    def others(self) -> tuple[str, ...]:
        """Values of neither profile."""
        return tuple(one for one in self.choices if one not in (self.published, self.extended))


def switch(meaning: str, published: str, extended: str, *others: str, **more: Any) -> Any:
    """A switch with the values of the profiles, and others; ``more`` as in `Switch`."""
    return Switch(
        meaning=meaning,
        choices=tuple(dict.fromkeys((published, extended, *others))),
        default={"published": published, "extended": extended}[DEFAULT_PROFILE],
        published=published,
        extended=extended,
        **more,
    )


@dataclass(frozen=True)
class Switches(DeclaredValues):
    """Base of a sensor's switches; by itself, for a sensor without any."""

    @classmethod
    def refusal(cls, name: str, text: str) -> ValueError:
        return ValueError(f"switch {name} {text}")

    @classmethod
    def of(cls, profile: str = DEFAULT_PROFILE, changes: str = "") -> Self:
        """A profile's switches with ``changes``: `SWITCH=VALUE`, separated by commas.

        ValueError names an unknown profile, switch or value.
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

    def differences(self, profile: str) -> dict[str, str]:
        """Values that differ from a profile, by name."""
        plain = type(self).of(profile)
        return {
            name: value
            for name in self.declared()
            if (value := getattr(self, name)) != getattr(plain, name)
        }

    @property
    def profile(self) -> str:
        """The matching profile, or ``MIXED``."""
        return next((one for one in PROFILES if self == type(self).of(one)), MIXED)
