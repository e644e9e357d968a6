"""Plans shipped with the devices, by name: files in a folder beside each one's studies."""

from importlib import resources
from pathlib import Path

from cubestack.host.devices.registry import devices

FOLDER = "campaigns"
SUFFIX = ".toml"


def known_plans() -> dict[str, Path]:
    folders = (
        resources.files(package).joinpath(FOLDER)
        for device in devices()
        if (package := device.study("campaign"))
    )
    files = (Path(str(file)) for folder in folders for file in folder.iterdir())
    return {file.stem: file for file in sorted(files) if file.suffix == SUFFIX}


def summary(path: Path) -> str:
    """A plan's purpose: the comment on its first line."""
    first, _, _ = path.read_text("utf-8").partition("\n")
    return first.removeprefix("#").strip() if first.startswith("#") else ""


def plan_file(given: str) -> Path:
    """The file of a path, or of the name of a shipped plan.

    Raises ValueError if it is neither.
    """
    path, known = Path(given), known_plans()
    if given in known and not path.exists():
        return known[given]
    if path.suffix != SUFFIX and not path.exists():
        names = ", ".join(known)
        raise ValueError(f"no plan is called {given!r}: give a {SUFFIX} file, or one of {names}")
    return path
