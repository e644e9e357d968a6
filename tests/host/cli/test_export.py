from pathlib import Path

import pytest

from cubestack.host.cli.export import OF_INTERFACE, OF_PROCESSOR
from cubestack.host.devices.registry import devices
from tests.conftest import Run


@pytest.mark.parametrize("form", [*OF_INTERFACE, *OF_PROCESSOR])
def test_out_writes_the_printed_text(form: str, run: Run, tmp_path: Path) -> None:
    for device in devices():
        printed = run("export", device.name, "--format", form)
        if form in OF_PROCESSOR and device.processor is None:
            assert (printed.code, printed.line) == (
                2,
                f"cubestack export: the processor of {device.name} runs no firmware of your own",
            )
            continue
        assert (printed.code, printed.err) == (0, "")
        path = tmp_path / "file"
        assert run("export", device.name, "--format", form, "--out", path) == (0, "", "")
        assert path.read_text(encoding="utf-8") == printed.out


def test_names_a_missing_folder(run: Run, tmp_path: Path) -> None:
    outcome = run("export", "aramis", "--format", "c", "--out", tmp_path / "not" / "there.h")
    assert outcome.code != 0
    assert "there.h" in outcome.line


def test_rejects_a_folder_as_output_file(run: Run, tmp_path: Path) -> None:
    outcome = run("export", "aramis", "--format", "c", "--out", tmp_path)
    assert outcome.code == 2
    assert outcome.line == (f"cubestack export: --out {tmp_path} is a folder; name a file in it")
