"""Draws the pictures of the pages about the ground page: `python -m docs.make_ground`.

It starts the page for two emulated devices, takes a picture with CubeStar, and takes screenshots
in chromium. It needs the extra `ground`, playwright, and chromium on the PATH.
"""

import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

IMAGES = Path(__file__).parent / "images"
SEED, WIDTH, HEIGHT, COLOURS = "5", 1280, 900, 256
WAIT_MS = 120_000


@contextmanager
def station() -> Iterator[str]:
    """The address of a page with a CubeStar and a CubeSense."""
    call = [sys.executable, "-m", "cubestack", "ground", "emulated:cubestar", "emulated:cubesense"]
    with subprocess.Popen([*call, "--seed", SEED, "--json"], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())["page"]
        finally:
            process.send_signal(signal.SIGINT)


def drawn(page: Page) -> Iterator[tuple[str, Image.Image]]:
    """Take a picture, then yield both screenshots with their names, in few colours."""
    page.set_default_timeout(WAIT_MS)
    page.click("nav >> text=CubeStar")
    page.click("#take")
    page.wait_for_selector("#picture >> text=/ detected, /")
    yield "ground.png", _small(page.screenshot())
    page.click("#tab-scene")
    page.wait_for_selector("#scene-status >> text=/camera/")
    page.mouse.move(0, 0)
    yield "ground-scene.png", _small(page.locator("#scene").screenshot())


def _small(png: bytes) -> Image.Image:
    return Image.open(BytesIO(png)).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)


def main() -> None:
    """Start everything, and draw."""
    with station() as address, sync_playwright() as playwright:
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(address)
        for name, image in drawn(page):
            image.save(IMAGES / name, optimize=True)
            print(IMAGES / name)
        browser.close()


if __name__ == "__main__":
    main()
