"""PNG files that say which command wrote them: only that command replaces one unasked."""

from contextlib import suppress
from io import BytesIO
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

from cubestack.firmware_model.formats.untrusted import UntrustedError, read_bytes
from cubestack.host.output import write_output

PICTURE, DEMO, CALIBRATE = "cubestack picture", "cubestack demo", "cubestack calibrate"
"""Commands whose pictures can be made again; anything else is never replaced unasked."""


def save_png(image: Image.Image, path: Path, command: str = "cubestack") -> None:
    """Write ``image``, with ``command`` as its text "Software"; raises ValueError if it cannot."""
    content, about = BytesIO(), PngInfo()
    about.add_text("Software", command)
    image.save(content, "png", pnginfo=about)
    write_output(path, content.getvalue())


def is_from(command: str, path: Path) -> bool:
    """Whether ``command`` wrote this picture."""
    with suppress(UntrustedError, OSError):
        return f"tEXtSoftware\0{command}".encode() in read_bytes(path)
    return False
