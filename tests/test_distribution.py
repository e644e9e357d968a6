import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def files_of_the_clone() -> set[str]:
    """Files in git; empty outside a clone."""
    call = ["git", "-C", str(ROOT), "ls-files", "-z"]
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        return set()
    found = subprocess.run(call, capture_output=True, text=True, check=True).stdout
    return {name for name in found.split("\0") if name and (ROOT / name).is_file()}


@pytest.mark.slow
def test_source_distribution_has_every_file(tmp_path: Path) -> None:
    files = files_of_the_clone()
    if not files:
        pytest.skip("this is no clone")
    tree = tmp_path / "tree"
    for name in files:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tree / name)
    call = [*(sys.executable, "-m", "build", "--sdist", "--no-isolation"), "-o", str(tmp_path)]
    subprocess.run([*call, str(tree)], check=True, capture_output=True)
    (made,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(made) as archive:
        packed = {one.name.partition("/")[2] for one in archive.getmembers() if one.isfile()}
    assert files <= packed
    added = {name for name in packed - files if ".egg-info/" not in name}
    assert added == {"PKG-INFO", "setup.cfg"}


@pytest.mark.xdist_group("kept together")
def test_pytest_xdist_groups_are_effective(request: pytest.FixtureRequest) -> None:
    """Some versions of pytest and xdist ignore groups without a warning."""
    if not request.config.getoption("loadgroup", False):
        pytest.skip("tests run in one process or without groups")
    assert request.node.nodeid.endswith("@kept together")
