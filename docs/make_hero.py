"""Draws README's picture and writes its caption: `python -m docs.make_hero`.

Both come from one run of the demonstration that `make run` shows. The caption is kept inside the
PNG file (its text chunk "Description"), so that picture and caption can not drift apart.
"""

import re
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

ROOT = Path(__file__).parent.parent
PICTURE = ROOT / "docs" / "images" / "sky-stars.png"
README = ROOT / "README.md"

CAPTION = re.compile(r"(?<=images/sky-stars\.png\)\n\n)\*(.+?)\*(?=\n\n)", re.DOTALL)
FOUND = re.compile(
    r"attitude from (\d+) stars.*?measured +RA +(\S+)° +Dec +(\S+)° +roll +(\S+)°"
    r".*?error: (\S+) arcsec across, [+-](\S+) arcsec about",
    re.DOTALL,
)
WIDTH = 120


def hero(folder: Path) -> tuple[Path, str]:
    """Run the demonstration in ``folder``; the picture's path, and its caption."""
    call = [sys.executable, "-m", "cubestack", "demo", "cubestar", "--out", str(folder)]
    printed = subprocess.run(call, check=True, capture_output=True, text=True).stdout
    found = FOUND.search(printed)
    assert found is not None, printed
    stars, ra, dec, roll, across, about = found.groups()
    return folder / PICTURE.name, (
        f"Orion as the emulated CubeStar saw it in a run of `make run`. It identified {stars} "
        f"stars and measured RA {ra}°, Dec {dec}°, roll {roll}°: {across} arcsec from the true "
        f"boresight, and {about} arcsec off in roll. Green marks show the sensor's own results; "
        "the yellow marks are the true places of bright stars, which it never sees."
    )


def caption_of(readme: str) -> str:
    """The caption below README's picture, without line breaks."""
    found = CAPTION.search(readme)
    assert found is not None, "README.md has no caption below images/sky-stars.png"
    return " ".join(found[1].split())


def main() -> None:
    """Replace the picture and README's caption."""
    with tempfile.TemporaryDirectory() as folder:
        drawn, caption = hero(Path(folder))
        about = PngInfo()
        about.add_itxt("Description", caption)
        with Image.open(drawn) as picture:
            picture.save(PICTURE, pnginfo=about, optimize=True)
    wrapped = "\n".join(textwrap.wrap(f"*{caption}*", WIDTH))
    README.write_text(CAPTION.sub(lambda _: wrapped, README.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    main()
