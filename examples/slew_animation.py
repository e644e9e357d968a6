"""An animation of a slow slew: the stars that a CubeStar finds, frame by frame.

python slew_animation.py FILE.gif [FRAMES]. The device runs in this process, in virtual time, with
profile "extended". Each frame shows an image and the stars that the device reported in it. Yellow
marks show the true positions of bright stars, which the device does not have.
"""

import sys
import time
from pathlib import Path

from PIL import Image

import cubestack
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.host.experiments.scene_truth import picture_of, true_stars
from cubestack.host.pictures.images import IDENTIFIED, UNKNOWN, star_sheet
from cubestack.host.pictures.sheet import GRID, PAPER, PLATE, TEXT, TRUTH
from cubestack.host.studies.cubestar.demo import left_out_by

FRAMES = 28
EVERY_S = 4.0
RATE_DEG_S = (0.0, 0.25, 0.0)
"""About the camera's x, y and z: to the right, by one degree per frame."""

START_DEG = (98.0, -6.0, 20.0)
WIDTH_PX = 640
SHOWN_MS = 220
GREYS, SHADES = 8, 3
"""Number of greys, and of steps from black to each colour of a mark, in the palette."""


def main(path: Path, frames: int) -> None:
    """Slew, draw each frame, and write the animation."""
    scene = SkyScene(quaternion_from_pointing(*START_DEG), rate_deg_s=RATE_DEG_S, seed=1)
    sheets, started, right = [], time.monotonic(), 0
    with cubestack.open_device("cubestar", scene, profile="extended") as emulated:
        device = emulated.client
        for number in range(frames):
            emulated.wait(max(0.0, EVERY_S * (number + 1) - emulated.time_s))
            device.capture_and_process()
            attitude, picture = device.attitude(), picture_of(emulated.board)
            truth = scene.truth(round(attitude.image_time_s * PS_PER_S))
            told = f"{attitude.image_time_s:6.1f} s: "
            told += (
                f"RA {attitude.ra_deg % 360:.2f}°, Dec {attitude.dec_deg:+.2f}°"
                if attitude.valid
                else "no attitude"
            )
            right += attitude.valid
            sheets.append(
                star_sheet(
                    picture,
                    device.stars(),
                    f"CubeStar on a slew of {RATE_DEG_S[1]:g}°/s; {told}",
                    left_out_by(device),
                    LENS.project,
                    true_stars(truth, LENS.project, picture.shape),
                )
            )
        virtual_s = emulated.time_s
    save(sheets, path)
    print(f"{frames} frames, {right} of them with an attitude; {virtual_s:.1f} s of virtual time")
    print(f"{path}: {path.stat().st_size} bytes, in {time.monotonic() - started:.1f} s")


def palette_colours() -> list[tuple[int, ...]]:
    """Colours of the sheets, with intermediate steps for smooth edges."""
    greys = [(255 * step // (GREYS - 1),) * 3 for step in range(GREYS)]
    shades = [
        tuple(part * step // SHADES for part in colour)
        for colour in (IDENTIFIED, UNKNOWN, TRUTH, GRID, TEXT)
        for step in range(1, SHADES + 1)
    ]
    return [*greys, PAPER, PLATE, *shades]


def save(sheets: list[Image.Image], path: Path) -> None:
    """Write a GIF that repeats: frames of one size, few colours, without dither."""
    height = max(sheet.height for sheet in sheets)
    small = []
    for sheet in sheets:
        whole = Image.new("RGB", (sheet.width, height), sheet.getpixel((0, sheet.height - 1)))
        whole.paste(sheet, (0, 0))
        size = (WIDTH_PX, round(WIDTH_PX * height / sheet.width))
        small.append(whole.resize(size, Image.Resampling.LANCZOS))
    palette = Image.new("P", (1, 1))
    palette.putpalette([part for colour in palette_colours() for part in colour])
    drawn = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in small]
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=SHOWN_MS, loop=0)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: python slew_animation.py FILE.gif [FRAMES]")
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else FRAMES)
