import json
from pathlib import Path

import pytest
from vcd import VCDWriter

from cubestack.host.cli.hdl.waveform import read

from ....conftest import Run

ABOUT = {
    "test": "tests/hdl/test_cubestar_top.py::test_stores[8-4-1]",
    "title": "whole_frame of tests/hdl/test_cubestar_top.py::test_stores[8-4-1], seed 1, on icarus",
    "error": "ACK is late",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Waveforms of a counter with an internal signal, and an empty one."""
    with (
        (tmp_path / "cubestar_top.stores-8-4-1.whole_frame.vcd").open("w") as file,
        VCDWriter(file, timescale="1 ps") as writer,
    ):
        data = writer.register_var("dut", "DATA", "wire", size=8)
        ack = writer.register_var("dut", "ACK", "wire", size=1, init="x")
        inside = writer.register_var("dut.writer", "STORE", "wire", size=1)
        plain = writer.register_var("dut", "stored", "wire", size=1)
        for step in range(1, 41):
            writer.change(data, 1000 * step, step)
            writer.change(inside, 1000 * step + 500, step % 2)
            writer.change(plain, 1000 * step + 501, step % 2)
        writer.change(ack, 41_000, 1)
    about = tmp_path / "cubestar_top.stores-8-4-1.whole_frame.json"
    about.write_text(json.dumps(ABOUT), encoding="utf-8")
    (tmp_path / "other.vcd").write_text("", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("name", ["whole_frame", "test_stores[8-4-1]", "cubestar_top.stores"])
def test_waveform_text_ends_where_the_test_failed(name: str, folder: Path, run: Run) -> None:
    outcome = run("hdl", "wave", name, "--folder", folder, "--last", 3, "--text")
    lines = outcome.out.splitlines()
    assert (outcome.code, *lines[:2]) == (
        0,
        "whole_frame of tests/hdl/test_cubestar_top.py::test_stores[8-4-1], seed 1, on icarus",
        "failed: ACK is late",
    )
    times = [line.split() for line in lines[4:7]]
    assert times == [["39.000", "DATA=27"], ["40.000", "DATA=28"], ["41.000", "ACK=1"]]
    assert [line.split() for line in lines[8:]] == [["ACK", "1"], ["DATA", "28"]]


def test_internal_signals_are_optional(folder: Path) -> None:
    path = folder / "cubestar_top.stores-8-4-1.whole_frame.vcd"
    assert read(path).signals == ["DATA", "ACK"]
    trace = read(path, 4, internal=True)
    assert set(trace.signals) == {"DATA", "ACK", "writer.STORE", "stored"}
    assert trace.moments == [
        (40_000, {"DATA": "28"}),
        (40_500, {"writer.STORE": "0"}),
        (40_501, {"stored": "0"}),
        (41_000, {"ACK": "1"}),
    ]


def test_opens_the_viewer_when_there_is_a_display(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, run: Run
) -> None:
    seen = tmp_path / "seen"
    viewer = tmp_path / "bin" / "surfer"
    viewer.parent.mkdir()
    viewer.write_text(f'#!/bin/sh\necho "$1" > {seen}\n', encoding="utf-8")
    viewer.chmod(0o755)
    monkeypatch.setenv("PATH", f"{viewer.parent}:/bin:/usr/bin")
    monkeypatch.setattr("cubestack.host.cli.hdl.waveform.VIEWERS", ("surfer",))
    monkeypatch.setenv("DISPLAY", ":0")
    assert run("hdl", "wave", "whole_frame", "--folder", folder).code == 0
    assert Path(seen.read_text().strip()).name == "cubestar_top.stores-8-4-1.whole_frame.vcd"


@pytest.mark.parametrize(
    ("arguments", "code", "error"),
    [
        (["none"], 1, "no waveform of 'none'; there are cubestar_top.stores-8-4-1.whole_frame, o"),
        (["r"], 2, "'r' fits cubestar_top.stores-8-4-1.whole_frame, other; say which"),
        (["missing.vcd"], 1, "there is no waveform missing.vcd"),
        (["whole_frame", "--last", "0"], 2, "must be at least 1, not 0"),
    ],
)
def test_waveform_command_rejects_wrong_arguments(
    arguments: list[str], code: int, error: str, folder: Path, run: Run
) -> None:
    outcome = run("hdl", "wave", *arguments, "--folder", folder)
    assert outcome.code == code
    assert error in outcome.err


@pytest.mark.parametrize("content", [b"", b"hello", b"\x00\xff", b"$scope module"])
def test_rejects_files_that_are_no_vcd(content: bytes, tmp_path: Path, run: Run) -> None:
    (tmp_path / "x.vcd").write_bytes(content)
    outcome = run("hdl", "wave", tmp_path / "x.vcd", "--text")
    assert outcome.code == (0 if not content else 2)
    assert content == b"" or "is no VCD file" in outcome.err
