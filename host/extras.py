"""Optional packages, which pyproject.toml lists as extras."""

import re
import shlex
from importlib.metadata import requires


def install_command(extra: str) -> str:
    """The command that installs the packages of an extra, wherever cubestack was installed from."""
    marker = re.compile(rf"\bextra == [\"']{extra}[\"']")
    lines = [one.partition(";") for one in requires("cubestack") or ()]
    return (
        f"pip install {shlex.join(name.strip() for name, _, when in lines if marker.search(when))}"
    )
