"""Failing starts of every command with an output that exists: it must stay as it was.

``python -m tests.host.cli.failing_starts COUNT`` begins each command that has an output option with
``--force``, an existing file, and a wrong input, until COUNT of them were refused, each for another
argument or kind. It prints the outputs that changed, and those with fewer refusals.
"""

import hashlib
import random
import sys
import tempfile
from pathlib import Path

from .wrong_inputs import TEXTS, Argument, arguments, case, make_files, outcome

SEED = 1
TRIES = 3
"""Wrong inputs per wanted refusal, at most: some are accepted."""

FEWEST = 8
"""Refusals of a command that has only one or two arguments."""

REFUSED_S = 2.0
"""A call that is still running then was not wrong."""


def outputs() -> list[tuple[Argument, str]]:
    """All options that name a file to write, and its place in the folder that some name."""
    found = [(one, getattr(one.action, "inside", None)) for one in arguments()]
    return [(one, inside) for one, inside in found if inside is not None]


def existing(folder: Path, inside: str) -> tuple[Path, Path]:
    """What the option names, and the file that is there."""
    named = folder / ("kept" if inside else "kept.png")
    place = named / inside if inside else named
    place.parent.mkdir(exist_ok=True)
    place.write_bytes(b"precious\n" * 1000)
    return named, place


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of each file below a folder."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


def refusable(one: Argument) -> list[str]:
    """Kinds of wrong inputs that an argument most likely refuses."""
    if one.is_file:
        return ["missing", "folder", "binary", "json", "brackets", "loop", "nested", "line"]
    checked = one.action.choices is not None or one.action.type is not None
    if checked or not one.action.option_strings:
        return list(TEXTS)
    return ["surrogate", "nested", "colon", "line"]


def refusals(output: Argument, inside: str, count: int, folder: Path) -> tuple[int, list[str]]:
    """Number of refused calls, at most ``count``, and the calls after which a file had changed."""
    wrong = [
        case(one, kind, folder)
        for one in arguments()
        if one.command == output.command and not hasattr(one.action, "inside")
        for kind in refusable(one)
    ]
    tried = random.Random(SEED).sample(wrong, min(len(wrong), TRIES * count))
    refused, changed = 0, []
    for one in tried:
        with tempfile.TemporaryDirectory(dir=folder) as place:
            named, _ = existing(Path(place), inside)
            before = digests(Path(place))
            words = (*one.words, output.name, str(named), "--force")
            status, _ = outcome(words, folder, REFUSED_S)
            if status in (None, 0):
                continue
            refused += 1
            if digests(Path(place)) != before:
                changed.append(one.kind)
        if refused == count:
            break
    return refused, changed


def try_all(count: int) -> int:
    """Print what is wrong; returns the number of it."""
    bad = 0
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        make_files(folder)
        for output, inside in outputs():
            refused, changed = refusals(output, inside, count, folder)
            name = f"{' '.join(output.command)} {output.name}"
            for one in changed:
                print(f"{name}: changed by {one}", flush=True)
            few = refused < min(count, FEWEST)
            if few:
                print(f"{name}: only {refused} refusals", flush=True)
            bad += len(changed) + few
            print(f"{name}: {refused}", file=sys.stderr, flush=True)
    return bad


if __name__ == "__main__":
    sys.exit(try_all(int(sys.argv[1])) > 0)
