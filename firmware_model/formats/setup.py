"""Construction of a recorded device, for the recording's header: enough to create it again."""

import re
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Option = bool | int | float | str


@dataclass(frozen=True)
class Document:
    """A file that the device was created from: its path as the user wrote it, and its content.

    ``files`` are those that the text names, by the last part of their path.
    """

    name: str
    text: str
    files: Mapping[str, bytes] = field(default_factory=dict)


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
    #: contents of files that options name, by the last part of their path
    files: Mapping[str, bytes] = field(default_factory=dict)

    def to_json(self) -> dict[str, object]:
        """Members with a value; for a real device only version and target."""
        content: dict[str, object] = {"version": self.version}
        if self.target:
            return content | {"target": self.target}
        content["seed"] = self.seed
        for name, document in (("scene", self.scene), ("faults", self.faults)):
            if document is not None:
                named = {"name": document.name, "text": document.text}
                content[name] = named | files_json(document.files)
        content |= {"options": dict(self.options)} if self.options else {}
        return content | files_json(self.files)

    @classmethod
    def from_json(cls, content: Any) -> "Setup":
        """Inverse of ``to_json``; raises ValueError."""
        if not isinstance(content, dict):
            raise ValueError('"setup" must be an object')
        unknown = set(content) - {
            "version",
            "target",
            "seed",
            "scene",
            "faults",
            "options",
            "files",
        }
        if unknown:
            raise ValueError(f'"setup" has no member {min(unknown)!r}')
        seed, options = content.get("seed", 0), content.get("options", {})
        if type(seed) is not int or seed < 0:
            raise ValueError(f'"seed" must be a whole number from 0, not {seed!r:.40}')
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
            files_of(content),
        )


def files_json(files: Mapping[str, bytes]) -> dict[str, Any]:
    """The member "files" of an object, absent without any."""
    return (
        {"files": {name: b64encode(one).decode() for name, one in files.items()}} if files else {}
    )


def files_of(content: dict[str, Any]) -> dict[str, bytes]:
    """Inverse of ``files_json``; raises ValueError."""
    found = content.get("files", {})
    if not isinstance(found, dict):
        raise ValueError('"files" must be an object of texts in base 64')
    files = {}
    for name, text in found.items():
        if not _NAME.fullmatch(name) or name in (".", ".."):
            raise ValueError(f'"files" has {name!r:.40}, which is no name of a file')
        try:
            files[name] = b64decode(text, validate=True)
        except (TypeError, ValueError):
            raise ValueError(f'"files": {name} must be a text in base 64') from None
    return files


_MEMBERS = {"version", "target", "seed", "scene", "faults", "options", "files"}
_NAME = re.compile(r"[^/\\\0]{1,60}")


def _document(content: dict[str, Any], name: str) -> Document | None:
    found = content.get(name)
    if found is None:
        return None
    if not isinstance(found, dict):
        raise ValueError(f'"{name}" must be an object with "name" and "text"')
    return Document(_text(found, "name"), _text(found, "text"), files_of(found))


def _text(content: dict[str, Any], name: str) -> str:
    found = content.get(name, "")
    if not isinstance(found, str):
        raise ValueError(f'"{name}" must be a text, not {found!r:.40}')
    return found
