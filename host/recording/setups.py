"""Set-up of a recorded device, from and to command options."""

import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType

from cubestack.firmware_model.formats.recording import Recording
from cubestack.firmware_model.formats.setup import Document, Option, Setup
from cubestack.firmware_model.formats.untrusted import (
    LARGEST_PICTURE,
    confined,
    parse_toml,
    read_bytes,
    read_text,
    shown,
)

DISTRIBUTION = "cubestack"


def emulated_setup(
    seed: int,
    scene: Path | None,
    faults: Path | None = None,
    options: Mapping[str, Option] | None = None,
) -> Setup:
    """Set-up of an emulated device; its files were already read."""
    return Setup(
        version(DISTRIBUTION),
        seed=seed,
        scene=None if scene is None else read_document(scene),
        faults=None if faults is None else read_document(faults),
        options=options or {},
    )


def taped_setup(target: str) -> Setup:
    """Set-up of a device that is not emulated here."""
    return Setup(version(DISTRIBUTION), target=target)


def setup_for(
    recording: Recording,
    *,
    seed: int | None,
    scene: Path | None,
    faults: Path | None,
    tell: Callable[[str], None],
    given: Mapping[str, Option] = MappingProxyType({}),
) -> Setup:
    """Set-up for a replay: the recorded one, with replacements.

    ``tell`` gets a line for each difference. Recorded files of options that are ``given`` anew
    are left out.
    """
    recorded = recording.setup
    if recorded is None:
        return emulated_setup(seed or 0, scene, faults)
    if recorded.target:
        tell(f"{recording.name} is of {recorded.target}, recorded by a host: times will differ")
    elif recorded.version != version(DISTRIBUTION):
        tell(f"{recording.name} was made by version {recorded.version} of {DISTRIBUTION}")
    if seed is not None and seed != recorded.seed and not recorded.target:
        tell(f"seed {seed} instead of {recorded.seed}, with which it was recorded")
    replaced = {
        split_mark(str(options[name]))[0].name
        for options in (recorded.options, given)
        for name in given
        if name in options
    }
    return Setup(
        version(DISTRIBUTION),
        seed=recorded.seed if seed is None else seed,
        scene=_chosen("scene", scene, recorded.scene, tell),
        faults=_chosen("plan of faults", faults, recorded.faults, tell),
        options=recorded.options,
        files={name: one for name, one in recorded.files.items() if name not in replaced},
    )


def _chosen(
    what: str, path: Path | None, recorded: Document | None, tell: Callable[[str], None]
) -> Document | None:
    if path is None:
        return recorded
    given = read_document(path)
    if recorded is None:
        tell(f"{what} {path}: it was recorded without one")
    elif given.text != recorded.text:
        tell(f"{what} {path} is not what it was recorded with, {recorded.name}")
    else:
        return recorded
    return given


def read_document(path: Path) -> Document:
    """A file's name and text for a recording, with the picture that it names, if any.

    Raises ValueError if it cannot be read.
    """
    try:
        text = read_text(path)
        return Document(str(path), text, _named_files(path, text))
    except OSError as error:
        raise ValueError(f"can not read {error.filename or path}: {error.strerror}") from None


def _named_files(path: Path, text: str) -> dict[str, bytes]:
    named = parse_toml(text, str(path)).get("file")
    if not isinstance(named, str):
        return {}
    picture = path.parent / named
    content = read_bytes(picture, LARGEST_PICTURE)
    return {picture.name: content} if len(content) <= LARGEST_RECORDED else {}


def option_files(options: Mapping[str, Option]) -> dict[str, bytes]:
    """Contents of the files that ``options`` name, without those that are missing or too large."""
    files = {}
    for value in options.values():
        path, _ = split_mark(str(value))
        with suppress(OSError, ValueError):
            files[path.name] = read_bytes(path, LARGEST_RECORDED)
    return files


def split_mark(value: str) -> tuple[Path, str]:
    """The path in an option's value, and what follows it: an address, a hash."""
    found = _MARK.search(value)
    assert found is not None
    return Path(value[: found.start()]), found[0]


_MARK = re.compile(r"(@(0[xX][0-9a-fA-F]+|[0-9]+))?(#[0-9a-f]{8,64})?$")

LARGEST_RECORDED = 32 << 20
"""Bytes of a file that becomes part of a recording."""


@contextmanager
def written(document: Document) -> Iterator[Path]:
    """A file with a document's text, beside the files that came with it.

    Within the block no other file can be read. Errors name the document.
    """
    with tempfile.TemporaryDirectory(prefix="cubestack-") as folder, confined(Path(folder)):
        copy = Path(folder) / "document"
        try:
            for name, content in document.files.items():
                (Path(folder) / name).write_bytes(content)
            copy.write_text(document.text, encoding="utf-8")
            yield copy
        except ValueError as error:
            raise ValueError(str(error).replace(str(copy), shown(document.name))) from None
