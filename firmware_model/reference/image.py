"""The prebuilt image of the reference firmware, which needs no compiler.

Beside it stands what it was built with, and its hash: ``python -m
cubestack.firmware_model.reference.image record FILE COMPILER`` writes that down.
"""

import hashlib
import json
import sys
from pathlib import Path

IMAGE = Path(__file__).with_name("cubestar.elf")


class ImageError(ValueError):
    """The image is not there, or not the one that was built; the text is one line."""


def reference_image() -> Path:
    """The image as built; ImageError when its hash is another."""
    if not IMAGE.exists():
        raise ImageError(f"{IMAGE} is missing: `make firmware` builds it")
    wanted, found = record_of(IMAGE)["sha256"], sha256_of(IMAGE)
    if found != wanted:
        raise ImageError(f"{IMAGE} has SHA-256 {found[:16]}, not {wanted[:16]} as recorded")
    return IMAGE


def sha256_of(image: Path) -> str:
    """Hexadecimal SHA-256 of a file."""
    return hashlib.sha256(image.read_bytes()).hexdigest()


def record_of(image: Path) -> dict[str, str]:
    """What is recorded of an image: ``sha256`` and ``compiler``."""
    text = image.with_suffix(".json").read_text(encoding="ascii")
    return {str(key): str(value) for key, value in json.loads(text).items()}


def _record(image: Path, compiler: str) -> None:
    record = {"compiler": compiler, "sha256": sha256_of(image)}
    text = json.dumps(record, indent=2) + "\n"
    image.with_suffix(".json").write_text(text, encoding="ascii")


if __name__ == "__main__":
    _command, _image, _compiler = sys.argv[1:]
    _record(Path(_image), _compiler)
