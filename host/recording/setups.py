"""Set-up of a recorded device, from and to command options."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from cubestack.firmware_model.formats.recording import Recording
from cubestack.firmware_model.formats.setup import Document, Option, Setup

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
) -> Setup:
    """Set-up for a replay: the recorded one, with replacements.

    ``tell`` gets a line for each difference.
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
    return Setup(
        version(DISTRIBUTION),
        seed=recorded.seed if seed is None else seed,
        scene=_chosen("scene", scene, recorded.scene, tell),
        faults=_chosen("plan of faults", faults, recorded.faults, tell),
        options=recorded.options,
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
    """A file's name and text for a recording; raises ValueError if it cannot be read."""
    try:
        return Document(str(path), path.read_text(encoding="utf-8", errors="replace"))
    except OSError as error:
        raise ValueError(f"can not read {path}: {error.strerror}") from None


@contextmanager
def written(document: Document) -> Iterator[Path]:
    """A file with a document's text: the original if unchanged, else a copy.

    Files that the text names are found only beside the original.
    """
    path = Path(document.name)
    try:
        same = path.read_text(encoding="utf-8", errors="replace") == document.text
    except OSError:
        same = False
    if same:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="cubestack-") as folder:
        copy = Path(folder) / (path.name or "recorded")
        copy.write_text(document.text, encoding="utf-8")
        yield copy
