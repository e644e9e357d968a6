"""Render the image that a star tracker captures of the sky at a known attitude.

The emulated camera exposes it as its firmware requests, with lens, noise and all else
of a scene file. The file has the grey values unchanged, unless --stretched makes faint
stars visible. If the device accepts uploads, its client's `upload_image` loads it into a
real one.

examples:
  cubestack picture {first} --ra 83.8 --dec -5.4 --roll 30 --out orion.png
  cubestack picture {first} --scene night.toml --out night.png
"""

import argparse
from dataclasses import replace
from functools import partial
from typing import Any

from cubestack.emulator.camera.common.image_sensor import StarSensor
from cubestack.emulator.camera.common.view import View
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.values import number, whole
from cubestack.host.cli.arguments import add_flag, add_output, add_path, add_value
from cubestack.host.clients.quaternions import pointing_deg
from cubestack.host.devices.registry import device, device_names
from cubestack.host.emulation.emulated import open_device
from cubestack.host.pictures.files import PICTURE, is_from
from cubestack.host.pictures.images import SKY, save_picture, stretched
from cubestack.host.terminal import say

ANGLES = {
    "ra": (0, 360, "right ascension of the boresight"),
    "dec": (-90, 90, "its declination"),
    "roll": (-360, 360, "angle of the picture's up direction, east of north (default 0)"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("device", choices=device_names())
    for name, (low, high, meaning) in ANGLES.items():
        add_value(parser, name, number(None, meaning, low, high, "deg"))
    add_path(parser, "--scene", "TOML scene; its pose counts")
    parser.add_argument("--mag-limit", type=float, metavar="V", help="only brighter stars")
    add_value(parser, "seed", whole(0, "of the noise (default 0)", 0))
    add_flag(parser, "--stretched", "lift faint stars for the eye; not for uploads")
    meaning = "image to write; replaces an earlier one of this command"
    add_output(
        parser, "--out", meaning, "FILE.png", required=True, renews=partial(is_from, PICTURE)
    )


def run(args: argparse.Namespace) -> int:
    if args.out.suffix.lower() != ".png":
        raise ValueError(f"--out must end in .png, not be {args.out}")
    with open_device(args.device, _scene(args), seed=args.seed) as emulated:
        emulated.client.take_picture()
        camera = getattr(emulated.board, "camera", None)
        assert isinstance(camera, StarSensor)
        picture, truth = camera.rendered, camera.scene.truth(emulated.board.kernel.now)
        assert picture is not None
    save_picture(stretched(picture, SKY) if args.stretched else picture, args.out, PICTURE)
    rows, columns = picture.shape
    say(f"{args.out}: {columns} x {rows} pixels")
    if truth is not None:
        ra, dec, roll = pointing_deg(truth)
        print(f"ra_deg {ra:.4f} dec_deg {dec:.4f} roll_deg {roll:.4f}")
        print("quaternion " + " ".join(f"{part:.9f}" for part in truth))
    return 0


def _scene(args: argparse.Namespace) -> Any:
    """The scene with the requested pose; raises ValueError without one."""
    if (args.ra is None) != (args.dec is None) or (args.ra is None and args.roll is not None):
        raise ValueError("a pose needs both --ra and --dec")
    if args.ra is None and args.scene is None:
        raise ValueError("needs a pose, --ra and --dec, or --scene FILE")
    found = device(args.device)
    seen = found.scene(args.scene) if args.scene else SkyScene.pointing(0, 0)
    sky = seen.scene if isinstance(seen, View) else seen
    if not isinstance(found.default_scene(), SkyScene):
        raise ValueError(f"{found.name} is no star tracker")
    if not isinstance(sky, SkyScene):
        raise ValueError(f"{args.scene} is no sky")
    if args.ra is not None:
        pose = quaternion_from_pointing(args.ra, args.dec, args.roll or 0.0)
        sky = replace(sky, quaternion=pose, rate_deg_s=(0.0, 0.0, 0.0), poses=())
    if args.mag_limit is not None:
        sky = replace(sky, mag_limit=args.mag_limit)
    return replace(seen, scene=sky) if isinstance(seen, View) else sky
