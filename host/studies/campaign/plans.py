"""Plans that come with the devices, by name: files in a folder beside each one's experiments."""

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
    """What a plan is for: the comment on its first line."""
    first, _, _ = path.read_text("utf-8").partition("\n")
    return first.removeprefix("#").strip() if first.startswith("#") else ""


def plan_file(given: str) -> Path:
    """The file that a user means by a path, or by the name of a plan that comes with a device.

    Raises ValueError for a name that is neither.
    """
    path, known = Path(given), known_plans()
    if given in known and not path.exists():
        return known[given]
    if path.suffix != SUFFIX and not path.exists():
        names = ", ".join(known)
        raise ValueError(f"no plan is called {given!r}: give a {SUFFIX} file, or one of {names}")
    return path
