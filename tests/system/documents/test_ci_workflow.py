"""The documented workflow for a repository with a design of its own, run in a chroot.

The chroot is an overlay of this machine's files: nothing that a step writes stays. Packages come
from the environment of these tests, so the network is not used; cubestack itself is built and
installed as the workflow says.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[3]
DESIGN = ROOT / "examples" / "own_gateware" / "frame_buffer.v"

#: In place of a runner's programs; pip is that of these tests.
SHIMS = {"sudo": 'exec "$@"', "apt-get": "exit 0", "pip": 'exec python -m pip "$@"'}

_ENTER = """
set -e
mount -t tmpfs tmpfs {scratch}
mkdir {scratch}/upper {scratch}/work {scratch}/root
cd {scratch}
mount -t overlay overlay -o lowerdir=/,upperdir=upper,workdir=work root
mount --rbind /proc root/proc
mount --rbind /dev root/dev
exec chroot root /bin/sh -e {steps}
"""


def enter(scratch: Path, steps: Path) -> list[str]:
    return ["unshare", "-m", "sh", "-c", _ENTER.format(scratch=scratch, steps=steps)]


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    """Where the chroot is mounted; the test is skipped where that is not allowed."""
    if shutil.which("iverilog") is None:
        pytest.skip("no Icarus Verilog")
    (folder := tmp_path / "scratch").mkdir()
    (tmp_path / "nothing").write_text("true\n")
    tried = subprocess.run(enter(folder, tmp_path / "nothing"), capture_output=True, check=False)
    if tried.returncode:
        pytest.skip("no chroot on an overlay: not root, or not allowed")
    return folder


def workflow() -> dict[str, dict[str, list[dict[str, str]]]]:
    text = (ROOT / "docs" / "how-to" / "ci.md").read_text(encoding="utf-8")
    first = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)[0]
    jobs: dict[str, dict[str, list[dict[str, str]]]] = yaml.safe_load(first)["jobs"]
    return jobs


@pytest.mark.slow
def test_gateware_workflow_passes_in_a_chroot(scratch: Path, tmp_path: Path) -> None:
    repository = tmp_path / "repository"
    (repository / "gateware").mkdir(parents=True)
    shutil.copy(DESIGN, repository / "gateware")
    tools = tmp_path / "tools"
    tools.mkdir()
    for name, text in SHIMS.items():
        (tools / name).write_text(f"#!/bin/sh\n{text}\n")
        (tools / name).chmod(0o755)
    venv = tmp_path / "venv"
    (tmp_path / "these.pth").write_text("\n".join(p for p in sys.path if p.endswith("-packages")))
    steps = [step["run"] for step in workflow()["gateware"]["steps"] if "run" in step]
    assert len(steps) > 4
    (tmp_path / "steps").write_text(
        "\n".join(
            [
                f"cd {tmp_path}",
                f"{sys.executable} -m venv --without-pip {venv}",
                f"for site in {venv}/lib/python*/site-packages; do cp these.pth $site; done",
                f"export PATH={tools}:{venv}/bin:$PATH CUBESTACK=file://{ROOT}",
                "export PIP_NO_BUILD_ISOLATION=0 PIP_NO_INDEX=1 PIP_DISABLE_PIP_VERSION_CHECK=1",
                f"cd {repository}",
                "set -x",
                *steps,
                "test -s hdl.xml",
            ]
        )
    )
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTEST", "VIRTUAL"))}
    done = subprocess.run(
        enter(scratch, tmp_path / "steps"),
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert not (repository / "hdl.xml").exists()  # it was the chroot's
