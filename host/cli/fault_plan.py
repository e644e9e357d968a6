"""Option --faults: a plan of faults for an emulated device."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cubestack.emulator.faults.injector import Faults


def add_faults_argument(parser: argparse.ArgumentParser) -> None:
    """Declare the option."""
    parser.add_argument(
        "--faults",
        type=Path,
        metavar="FILE",
        help="TOML plan of faults, with their seed (see docs/faults.md)",
    )


def inject_plan(
    faults: Faults, path: Path | None, say: Callable[[str], None] | None = None
) -> None:
    """Inject the plan in ``path``, if one is given; ``say`` is told what each fault does.

    Raises FaultError (a ValueError) for a plan that makes no sense.
    """
    from cubestack.emulator.faults.plan import load_plan

    if path is None:
        return
    faults.load(load_plan(path))
    if say is not None:
        tell = say
        faults.on_event = lambda event: tell(str(event))
