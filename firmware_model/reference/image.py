"""The prebuilt image of the reference firmware, which needs no compiler.

A JSON file beside it records its compiler and its hash: ``python -m
cubestack.firmware_model.reference.image record FILE COMPILER`` writes it.
"""

import hashlib
import json
import sys
from pathlib import Path

IMAGE = Path(__file__).with_name("cubestar.elf")


class ImageError(ValueError):
    """The image is missing, or its hash differs from the recorded one; the text is one line."""


def reference_image() -> Path:
    """The image as built; raises ImageError if its hash is wrong."""
    if not IMAGE.exists():
        raise ImageError(f"{IMAGE} is missing: `make firmware` builds it")
    wanted, found = record_of(IMAGE)["sha256"], sha256_of(IMAGE)
    if found != wanted:
        raise ImageError(f"{IMAGE} has SHA-256 {found[:16]}, not {wanted[:16]} as recorded")
    return IMAGE


def sha256_of(image: Path) -> str:
    return hashlib.sha256(image.read_bytes()).hexdigest()


def record_of(image: Path) -> dict[str, str]:
    text = image.with_suffix(".json").read_text(encoding="ascii")
    return {str(key): str(value) for key, value in json.loads(text).items()}


def _record(image: Path, compiler: str) -> None:
    record = {"compiler": compiler, "sha256": sha256_of(image)}
    text = json.dumps(record, indent=2) + "\n"
    image.with_suffix(".json").write_text(text, encoding="ascii")


if __name__ == "__main__":
    _command, _image, _compiler = sys.argv[1:]
    _record(Path(_image), _compiler)
