from pathlib import Path

from ....conftest import Run


def test_verilog_to_a_file_and_to_standard_output(tmp_path: Path, run: Run) -> None:
    text = run("hdl", "verilog", "cubestar").out
    assert text.startswith("// CubeStar frame buffer")
    assert run("hdl", "verilog", "cubestar", "--out", tmp_path / "cubestar.v").out == ""
    assert (tmp_path / "cubestar.v").read_text(encoding="utf-8") == text


def test_first_letters_of_a_top_must_fit_one(run: Run) -> None:
    assert run("hdl", "verilog", "cubestar-sh").out.startswith("// CubeStar")
    outcome = run("hdl", "verilog", "cubestar-")
    assert outcome.code == 2
    assert "'cubestar-' fits cubestar-shared, cubestar-" in outcome.line
