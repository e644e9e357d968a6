"""What the page of AraMiS' figures says, against what is there."""

import re
from pathlib import Path

from cubestack.host.cli.main import make_parser


def test_commands_and_files_of_the_fidelity_page_exist(root: Path) -> None:
    page = (root / "docs" / "fidelity-aramis.md").read_text(encoding="utf-8")
    commands = re.findall(r"`measure (--[^`]+)`", page)
    assert len(commands) >= 7
    for command in commands:
        make_parser().parse_args(["measure", "aramis", "--json", *command.split()])
    others = re.findall(r"`\.venv/bin/cubestack ((?!measure)\w[^`]*)`", page)
    assert len(others) >= 2
    for command in others:
        make_parser().parse_args(command.split())
    files = re.findall(r"`(\w+/[\w/]+\.py)`", page)
    assert len(files) >= 6
    for file in files:
        assert (root / file).is_file(), file
    for module in re.findall(r"`python -m ([\w.]+)", page):
        assert (root / (module.replace(".", "/") + ".py")).is_file(), module


def test_reasons_of_the_page_are_those_of_the_interface(root: Path) -> None:
    from cubestack.firmware_model.interface.aramis import Reason

    page = (root / "docs" / "fidelity-aramis.md").read_text(encoding="utf-8")
    for name in re.findall(r"`([A-Z_]{5,})`", page):
        assert name in Reason.__members__, name
