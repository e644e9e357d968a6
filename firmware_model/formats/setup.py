"""Construction of a recorded device, for the recording's header: enough to create it again."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Option = bool | int | float | str


@dataclass(frozen=True)
class Document:
    """A file that the device was created from: its path as the user wrote it, and its content."""

    name: str
    text: str


@dataclass(frozen=True)
class Setup:
    """How a device was created."""

    version: str  #: of this project
    target: str = ""  #: recorded device, as the user wrote it; empty if it was emulated here
    seed: int = 0  #: of all random numbers
    scene: Document | None = None  #: what it saw; None for the device's default
    faults: Document | None = None  #: fault plan
    #: other options with a non-default value, by name
    options: Mapping[str, Option] = field(default_factory=dict)

    def to_json(self) -> dict[str, object]:
        """Members with a value; for a real device only version and target."""
        content: dict[str, object] = {"version": self.version}
        if self.target:
            return content | {"target": self.target}
        content["seed"] = self.seed
        for name, document in (("scene", self.scene), ("faults", self.faults)):
            if document is not None:
                content[name] = {"name": document.name, "text": document.text}
        return content | ({"options": dict(self.options)} if self.options else {})

    @classmethod
    def from_json(cls, content: Any) -> "Setup":
        """Inverse of ``to_json``; raises ValueError."""
        if not isinstance(content, dict):
            raise ValueError('"setup" must be an object')
        unknown = set(content) - {"version", "target", "seed", "scene", "faults", "options"}
        if unknown:
            raise ValueError(f'"setup" has no member {min(unknown)!r}')
        seed, options = content.get("seed", 0), content.get("options", {})
        if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
            raise ValueError(f'"seed" must be a whole number from 0, not {seed!r}')
        if not isinstance(options, dict) or not all(
            isinstance(value, Option) for value in options.values()
        ):
            raise ValueError('"options" must be an object of numbers, texts, true and false')
        return cls(
            _text(content, "version"),
            _text(content, "target"),
            seed,
            _document(content, "scene"),
            _document(content, "faults"),
            options,
        )


def _document(content: dict[str, Any], name: str) -> Document | None:
    found = content.get(name)
    if found is None:
        return None
    if not isinstance(found, dict):
        raise ValueError(f'"{name}" must be an object with "name" and "text"')
    return Document(_text(found, "name"), _text(found, "text"))


def _text(content: dict[str, Any], name: str) -> str:
    found = content.get(name, "")
    if not isinstance(found, str):
        raise ValueError(f'"{name}" must be a text, not {found!r}')
    return found
