"""The libraries that come along are those of what is shipped."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.emulator.native.ready_made import FOLDER, TARGETS, hash_of
from cubestack.host.emulation import libraries

MAKE = "python -m cubestack.host.emulation.libraries"


def test_each_device_has_its_own_for_every_machine_and_there_are_no_others() -> None:
    program = (  # in a process that has loaded none of them
        "from cubestack.host.emulation import libraries\n"
        "for one in libraries.needed(): print(one.inputs.hex())\n"
    )
    call = [sys.executable, "-c", program]
    asked = subprocess.run(call, check=True, capture_output=True, text=True).stdout.split()
    inputs = map(bytes.fromhex, asked)
    wanted = {f"{machine}-{hash_of(one)}" for one in inputs for machine in TARGETS}
    found = {path.name.rpartition("-")[0] for path in FOLDER.iterdir()}
    assert found == wanted, f"what they are made of has changed: {MAKE}"


def test_a_device_starts_compiled_where_there_is_no_compiler(tmp_path: Path) -> None:
    program = (
        "from cubestack.emulator.native import compiler\n"
        "from cubestack.host.emulation.emulated import open_device\n"
        "compiler.find_compiler = lambda: None\n"
        "with open_device('cubesense', engine='compiled') as device:\n"
        "    print(device.client.capture(1))\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    environment.pop("CXX", None)
    call = [sys.executable, "-W", "error", "-c", program]
    subprocess.run(call, check=True, env=environment, timeout=120)
    assert [path.suffix for path in (tmp_path / "cubestack").iterdir()] == [".so"]


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="no compiler for all")
def test_they_are_what_their_sources_give(tmp_path: Path) -> None:
    libraries.make(libraries.needed()[:1], tmp_path, print)
    made = {path.name for path in tmp_path.iterdir()}
    assert made <= {path.name for path in FOLDER.iterdir()}
