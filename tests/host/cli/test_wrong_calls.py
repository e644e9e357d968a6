from pathlib import Path

import pytest

from ...conftest import Run

FAILED, WRONG_CALL = 1, 2


@pytest.mark.parametrize(
    "wrong",
    [
        ("", "COMMAND"),
        ("launch", "no command 'launch'; see cubestack --help"),
        ("emulat", "no command 'emulat'; did you mean emulate?; see cubestack emulate --help"),
        ("--versoin", "unknown argument --versoin; did you mean --version?; see cubestack --help"),
        ("emulate --paice fast", "--paice; did you mean --pace?; see cubestack emulate --help"),
        ("hdl prov", "did you mean prove?; see cubestack hdl prove --help"),
        ("export cubestar --format xcte", "--format: must be", "did you mean xtce?"),
        ("measure", "device"),
        ("measure cubestarr", "cubestarr", "cubestar"),
        ("measure cubestar --profle extended", "did you mean --profile?; see cubestack measure"),
        ("measure aramis --gateware a.v", "--gateware is an option of cubestar, cubesense"),
        ("hdl prove --devise cubestar", "did you mean --device?; see cubestack hdl prove --help"),
        ("emulate cubestarr", "cubestarr", "cubestar"),
        ("measure cubestar --frames 0", "0", "at least 1"),
        ("measure cubestar --crop 0;256", "0;256", "a list of 2 numbers"),
        ("measure cubestar --crop 0,256", "--crop", "--image"),
        ("measure cubestar --camera c.json", "--camera", "--image"),
        ("measure cubestar --image a.png --scene b.toml", "--scene", "--image"),
        ("measure cubestar --mag-limit nan", "mag-limit", "nan", "number"),
        ("measure cubestar --scene a.toml --mag-limit 3", "scene", "mag_limit"),
        ("measure cubestar --image a.png --false-stars 1", "--false-stars"),
        ("measure cubestar --image a.png --no-noise", "--no-noise"),
        ("catalogue --epoch inf", "--epoch: must be a number, not inf"),
        ("demo --seed -1", "seed", "-1"),
        ("measure cubestar --mode guessing", "guessing", "tracking"),
        ("emulate cubestar --pty a --tcp 4000", "--pty", "--tcp"),
        ("emulate cubestar --tcp 0 --rfc2217 0", "--rfc2217: not allowed with argument --tcp"),
        ("emulate cubestar --tcp 70000", "70000", "65535"),
        ("emulate aramis --engine compiled", "--engine", "FPGA"),
        ("emulate cubestar cubestar", "once", "cubestar"),
        ("emulate cubestar --mcu-addressing", "--mcu-addressing", "cubesense"),
        ("emulate cubestar --i2c 256", "256", "255"),
        ("emulate cubestar --baud 0", "baud", "0"),
        ("emulate cubestar --pace slow", "slow", "fast"),
        ("registers cubestar --format pdf", "pdf", "markdown"),
        ("measure cubestar --scene missing.toml", "missing.toml", "No such file"),
        ("measure cubestar --image missing.png", "missing.png", "No such file"),
        ("measure cubesense --search samples --memory other", "--memory other"),
        ("measure cubesense --scene a.toml --tilt 3", "--tilt", "scene"),
        ("measure cubesense --scene a.toml --no-noise", "--no-noise", "scene"),
        ("measure cubesense --mode lis", "--mode"),
        ("-v -q bench", "not allowed with"),
        ("campaign nothing.toml", "No such file"),
        ("campaign a.toml b.toml", "one plan at a time"),
        ("campaign report", "report wants a campaign's folder"),
        ("campaign a.toml --compare b", "--compare is for a report"),
        ("campaign replay", "replay wants a campaign's folder and the number of a row"),
        ("campaign parquet", "parquet wants a campaign's folder"),
        ("campaign replay nowhere 1", "nowhere is no campaign's folder"),
        ("hazards cubestar --hazard rain", "cubestar has no 'rain'; known: aberration"),
        ("hazards nobody", "no device 'nobody'; known: cubestar"),
        ("catalogue aramis --pair-limit 40", "--pair-limit has no effect for aramis"),
        ("catalogue --fov 20", "--fov has no effect for cubestar"),
        ("catalogue cubestar --output x", "--output has no effect for cubestar"),
        ("catalogue aramis --fov 100", "fov_deg must be 1 to 60 deg, not 100.0"),
        ("catalogue aramis --mag-limit 9", "mag_limit must be 0 to 7.5, not 9.0"),
        ("catalogue aramis --fov 1 --mag-limit 1", "stars form no triangle"),
        ("costs measure --level O9", "--level must be one of O0, O2, Os, not O9"),
        (
            "costs measure --precision half",
            "--precision must be one of own, float, literals, double, not half",
        ),
        ("fidelity --rows colour", "no row is like colour"),
        ("fidelity --write --quick", "--write measures rows whole: without --quick"),
        ("new-sensor sun-slit", "a device's name is an identifier of small letters, not sun-slit"),
        ("new-sensor Glow", "a device's name is an identifier of small letters, not Glow"),
        ("new-sensor class", "a device's name is an identifier of small letters, not class"),
        ("new-sensor aramis", "aramis is a device already; choose another name"),
        ("new-sensor numpy", "numpy is a Python module already; choose another name"),
        ("hdl verilog cubestarr", "cubestarr", "cubesense-sun"),
        ("hdl area cubesense-pair", "cubesense-pair", "cubesense-sun"),
        ("hdl verilog cubestar --out /missing/cubestar.v", "can not write /missing/cubestar.v"),
        ("hdl prove sun-scam", "sun-scam", "sun-scan"),
        ("hdl paint", "paint", "area", "verilog"),
        ("hdl", "ACTION"),
        ("registers aramis --processor", "aramis runs no firmware of your own"),
        ("campaign", "name a plan: a file, or one of --list"),
        ("memory cubesense --firmware x", "--firmware is an option of cubestar alone"),
        ("memory cubesense --seconds 3", "--seconds has no effect for cubesense"),
        (
            "run --device cubestar --device aramis --faults x -- true",
            "--scene and --faults are of one device, and several are emulated",
        ),
        (
            "run --device cubestar --device aramis --scene x -- true",
            "--scene and --faults are of one device",
        ),
        ("emulate cubestar --gdb-wait", "--gdb-wait: give the port as well: --gdb PORT"),
        (
            "ground /dev/nothing --device cubestar --profile extended",
            "--profile extended is for emulated:DEVICE",
        ),
    ],
    ids=lambda wrong: wrong[0],
)
def test_wrong_call_is_one_line_and_writes_nothing(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, *words = wrong
    outcome = run(*arguments.split())
    failed = "No such file" in words and not arguments.startswith("measure")
    assert outcome.code == (FAILED if failed else WRONG_CALL)
    assert outcome.line.startswith("cubestack")
    assert [word for word in words if word not in outcome.line] == []
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "option",
    [
        *("scene=x.toml", "faults=x.toml", "record=x.rec", "trace=x.vcd", "set=a=b", "gdb=7"),
        *("gdb-wait", "profile-out=x", "coverage-out=x"),
    ],
)
def test_option_of_one_device_is_rejected_for_several(run: Run, option: str) -> None:
    outcome = run("emulate", "cubestar", "aramis", f"--{option}")
    assert outcome.code == WRONG_CALL
    name = option.partition("=")[0]
    assert outcome.line.endswith(f"--{name} applies to one device, but several are given")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("decode", "{folder}/none.rec"), "{folder}/none.rec: No such file or directory"),
        (("replay", "{folder}"), "{folder} is a folder, not a regular file"),
        (
            ("demo", "--out", "/proc/cubestack"),
            "can not write /proc/cubestack: No such file or directory",
        ),
        (
            ("measure", "cubestar", "--scene", "{folder}"),
            "{folder} is a folder, not a regular file",
        ),
        (
            ("measure", "cubestar", "--firmware", "{folder}"),
            "{folder} is a folder, not a regular file",
        ),
        (
            ("export", "aramis", "--format", "c", "--out", "{folder}"),
            "--out {folder} is a folder; name a file in it",
        ),
        (
            ("export", "aramis", "--format", "c", "--out", "{folder}/not/there.h"),
            "can not write {folder}/not/there.h: No such file or directory",
        ),
        (
            ("shell", "/dev/ttyNONE", "--device", "cubestar"),
            "can not open /dev/ttyNONE: No such file or directory",
        ),
        (
            ("shell", "/dev/null", "--device", "cubestar"),
            "can not open /dev/null: it is no serial port (Inappropriate ioctl for device)",
        ),
        (
            ("emulate", "aramis", "--pty", "{folder}/none/tty"),
            "can not create the link {folder}/none/tty: No such file or directory",
        ),
        (
            ("emulate", "aramis", "--tcp", "0", "--listen", "192.0.2.1", "--allow-remote"),
            "can not listen on 192.0.2.1:0: Cannot assign requested address; choose another port",
        ),
        (
            ("emulate", "aramis", "--control", "0", "--listen", "0.0.0.0"),
            "0.0.0.0 can be reached from other machines: take 127.0.0.1, or give --allow-remote",
        ),
        (
            ("emulate", "aramis", "--listen", "0.0.0.0"),
            "--listen: of which port? It goes with --tcp, --rfc2217 or --control",
        ),
    ],
)
def test_error_is_one_plain_line(
    run: Run, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    outcome = run(*(word.format(folder=tmp_path) for word in words))
    wrong_call = "regular file" in said or said.startswith(("--", "can not write"))
    assert outcome.code == (WRONG_CALL if wrong_call else FAILED)
    assert outcome.line == f"cubestack {words[0]}: {said.format(folder=tmp_path)}"
