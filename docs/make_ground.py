"""Draws the pictures of the pages about the ground page: `python -m docs.make_ground`.

It starts the page for two emulated devices, has CubeStar capture an image, and takes screenshots
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
SEED, WIDTH, HEIGHT, COLOURS = "5", 1280, 1500, 256
WAIT_MS, SETTLED_MS = 120_000, 3000


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


def save(png: bytes, name: str) -> None:
    """Write a screenshot with few colours, as a small file."""
    image = Image.open(BytesIO(png)).convert("RGB")
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(IMAGES / name, optimize=True)
    print(IMAGES / name)


def draw(page: Page) -> None:
    """Capture an image, and take both screenshots."""
    page.set_default_timeout(WAIT_MS)
    page.click("nav >> text=CubeStar")
    page.wait_for_selector("#scene-status >> text=/camera/")
    page.fill("#line", "write CaptureAndProcess")
    page.press("#line", "Enter")
    page.wait_for_selector("#timeline >> text=/CALCULATED/")
    page.check("#detections")
    page.wait_for_selector("#picture >> text=/ detected, /")
    page.wait_for_timeout(SETTLED_MS)
    page.evaluate("window.scrollTo(0, 0)")
    save(page.screenshot(), "ground.png")
    save(page.locator("#scene").screenshot(), "ground-scene.png")


def main() -> None:
    """Start everything, and draw."""
    with station() as address, sync_playwright() as playwright:
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(address)
        draw(page)
        browser.close()


if __name__ == "__main__":
    main()
