"""OpenC3's classes as an oracle, in an environment of their own (docs/how-to/exports.md)."""

import json
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.export.cosmos.plugin import cosmos_plugin

#: A Python interpreter that has the package openc3.
VARIABLE = "CUBESTACK_OPENC3"

NEEDS_OPENC3 = pytest.mark.skipif(
    VARIABLE not in os.environ, reason=f"{VARIABLE} names no Python with openc3"
)

TIMEOUT_S = 900


def write_plugin(interface: Interface, folder: Path, **variables: str) -> None:
    """The plug-in's folder as COSMOS has it after an installation with these variables."""
    for path, text in cosmos_plugin(interface).items():
        place = folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(render(text, interface, **variables), encoding="utf-8")


def render(text: str, interface: Interface, **variables: str) -> str:
    """``text`` with its variables replaced: those parts of ERB that the plug-in uses."""
    prefix = f"{interface.name.lower()}_"
    declared = dict(re.findall(r"^VARIABLE (\S+) (\S+)$", text, re.MULTILINE))
    declared |= {prefix + name: value for name, value in variables.items()}
    declared["target_name"] = interface.name.upper()
    branch = re.compile(r'<% if (\w+) == "(\w*)" %>\n(.*?)<% else %>\n(.*?)<% end %>\n', re.DOTALL)
    text = branch.sub(lambda found: found[3 if declared[found[1]] == found[2] else 4], text)
    text = re.sub(r"<%= (\w+) %>", lambda found: declared[found[1]], text)
    assert "<%" not in text
    return text


def ask(work: str, interface: Interface, folder: Path, questions: Any = None) -> Any:
    """What the function ``work`` of peer.py returns for the plug-in in ``folder``."""
    asked, answered = folder / "questions.json", folder / "answers.json"
    asked.write_text(json.dumps(questions))
    peer = Path(__file__).with_name("peer.py")
    command = [os.environ[VARIABLE], peer, work, folder, interface.name.upper(), asked, answered]
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, timeout=TIMEOUT_S
    )
    assert done.returncode == 0, done.stderr
    return json.loads(answered.read_text())
