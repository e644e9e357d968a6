"""Waveforms of failing tests: one VCD file and a JSON file beside it for each.

The folder is read by `cubestack hdl wave`. A test's files go when it is run again.
"""

import json
import re
from pathlib import Path

from tests.hdl.regression import BASE_SEED, HERE, SIMULATOR, Outcome

#: Where they are kept.
FOLDER = HERE.parents[1] / "out" / "hdl" / "waves"


def names(node: str) -> str:
    """Name of a test's files, from what pytest calls it: ``test_x.py::test_y[8-4]`` is x.y-8-4."""
    file, _, test = node.partition("::")
    parts = Path(file).stem.removeprefix("test_"), test.removeprefix("test_")
    return ".".join(re.sub(r"\W+", "-", part).strip("-") for part in parts)


def forget(folder: Path, node: str) -> None:
    """Remove what an earlier run of the test kept."""
    for path in folder.glob(f"{names(node)}.*"):
        path.unlink(missing_ok=True)


def path_of(folder: Path, node: str, case: str) -> Path:
    """Where the waveform of a test's cocotb test ``case`` goes; its folder is made."""
    folder.mkdir(parents=True, exist_ok=True)
    plain = re.sub(r"[^\w.]+", "-", case)
    return folder / f"{names(node)}.{plain}.vcd"


def describe(path: Path, node: str, seed: int, failed: Outcome, again: Outcome) -> str:
    """Write what the waveform shows beside it; a line for the reader.

    ``failed`` is the run of all tests, ``again`` the first failed one alone.
    """
    if not path.exists():
        return "no waveform was written"
    about = {
        "test": node,
        "cocotb": failed.failed[0],
        "seed": seed + BASE_SEED,
        "simulator": SIMULATOR,
        "error": failed.error,
    }
    path.with_suffix(".json").write_text(json.dumps(about, indent=1), encoding="utf-8")
    alone = "" if again.failed else ", in which it passed alone"
    return f"waveform{alone}: {path}; look at it with: cubestack hdl wave {path.stem}"
