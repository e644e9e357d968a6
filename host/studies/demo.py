"""Run the whole stack in about a minute: boot, capture, measure and download, with
pictures.

An emulator process serves a device on pseudo-terminals; a client in this
process talks to it through pyserial and nothing else. A star tracker looks at
a rendered sky, and may look at a photograph, one of --photographs if that
folder has any; a sun and nadir sensor at the Sun, and at the Earth from 750 km.
"""

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.values import whole
from cubestack.host.cli.arguments import add_path, add_value
from cubestack.host.cli.device_options import add_option, given_options
from cubestack.host.clients.contract import Progress
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.device import PROFILE_OPTIONS, BoardT_co, ClientT_co, Device
from cubestack.host.devices.registry import devices
from cubestack.host.emulation.process import emulating
from cubestack.host.errors import PortClosedError, PortOpenError
from cubestack.host.output import output_folder, write_output
from cubestack.host.pictures.files import DEMO, is_from
from cubestack.host.terminal import busy, head, say, tell
from cubestack.host.transport.streams import open_transport


def add_arguments(parser: argparse.ArgumentParser) -> None:
    names = [one.name for one in devices() if "demo" in one.studies]
    parser.add_argument("device", nargs="?", choices=names, help="run this one only; default: all")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the pictures")
    add_path(
        parser,
        "--photographs",
        "folder with JPEG photographs of the sky and their truth.json",
        "DIR",
    )
    add_value(parser, "seed", whole(1, "seed of the sensors' noise (default 1)", 0))
    for option in PROFILE_OPTIONS:
        add_option(parser, option)


def run(args: argparse.Namespace) -> int:
    """Show the devices; returns 1 if one of them did not find its target."""
    output_folder(args.out)
    board = [f"--{name}={value}" for name, value in given_options(args).items()]
    found = [
        one.study("demo")(one, args.out, args.seed, args.photographs, board)
        for one in devices()
        if "demo" in one.studies and args.device in (None, one.name)
    ]
    return 0 if all(found) else 1


ANSWER_TIMEOUT_S = 60.0
"""Wall time: a busy machine may stop an emulator for seconds; its end is reported at once."""


class Demo:
    """One subject of a demonstration: its title, the device that looks at it, and its pictures.

    Attributes:
        out: folder of everything that is written.
        name: stem of the scene file.
        pictures: names of the pictures.
    """

    def __init__(self, out: Path, name: str, title: str, *pictures: str) -> None:
        """Begin; raises ValueError for a file in the way that no earlier demonstration wrote."""
        self.out = out
        self.name = name
        self.pictures = pictures
        self._check()
        self._started = time.monotonic()
        head(title)

    @contextmanager
    def client(
        self, device: Device[BoardT_co, ClientT_co], scene: str, board: Sequence[str] = ()
    ) -> Iterator[tuple[ClientT_co, Path]]:
        """A client of ``device`` with ``scene``, a TOML text; and the port's path.

        ``board`` are arguments of `cubestack emulate`.
        """
        path = self.out / f"{self.name}.toml"
        write_output(path, scene)
        words = [device.name, "--scene", str(path), *board]
        with _served(words, self.out / f"tty{device.name.upper()}") as port:
            line = open_transport(str(port), device.interface.baud)
            node = NodeClient(line, device.interface, timeout_s=ANSWER_TIMEOUT_S)
            yield device.client(node), port
            node.close()

    def _check(self) -> None:
        for name in self.pictures:
            path = self.out / name
            if path.exists() and not is_from(DEMO, path):
                raise ValueError(f"{path} exists, and no demo wrote it; choose another --out")

    def finish(self, virtual_s: float | None = None) -> None:
        wall = f"{time.monotonic() - self._started:.1f} s of wall time"
        times = wall if virtual_s is None else f"{virtual_s:.1f} s of virtual time in {wall}"
        names = ", ".join(str(self.out / picture) for picture in self.pictures)
        tell(f"{times}; pictures: {names}")


@contextmanager
def _served(words: Sequence[str], port: Path) -> Iterator[Path]:
    """An emulator process with arguments ``words`` that serves on ``port``."""
    say("starting the emulator")
    line = ""
    try:
        with emulating([*words, "--pty", str(port), "--pace", "fast"]) as said:
            for line in said:
                say(line)  # its port, progress, or an error
                if port.exists():
                    break
            else:
                raise PortOpenError("the emulator did not start")
            yield port
    except PortClosedError:
        say(f"the emulator ended: {[line, *said][-1]}")
        raise


def download(what: str, fetch: Callable[[Progress], NDArray[np.uint8]]) -> NDArray[np.uint8]:
    with busy(f"downloading {what}") as shown:
        return fetch(shown)


def tell_times(phases_ms: dict[str, float], indent: str = "") -> None:
    times = ", ".join(f"{name} {ms:.1f} ms" for name, ms in phases_ms.items())
    tell(f"{indent}virtual time: {times}")
