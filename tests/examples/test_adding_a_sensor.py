import ast
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

import cubestack as library
from cubestack.host.cli.new_sensor import rendered
from cubestack.host.devices.registry import device
from cubestack.host.ground import scenes

from ..conftest import Run
from ..forked import forked, of_pytest
from .conftest import ROOT, Installed, installed, plugins

Command = Callable[..., str]
Edit = tuple[str, str, str]

TABLES, SENSOR = "glow/__init__.py", "glow/sensor.py"
PUBLIC = {"cubestack", "cubestack.sensor", "cubestack.hdl.blocks"}


@contextmanager
def new_sensor(folder: Path, *edits: Edit) -> Iterator[Installed]:
    """The files of `cubestack new-sensor glow`, edited: (file, old text, new text)."""
    project = folder / "glow-sensor"
    for path, text in rendered("glow"):
        for _, old, new in (edit for edit in edits if edit[0] == path):
            assert text.count(old) == 1
            text = text.replace(old, new)
        (project / path).parent.mkdir(parents=True, exist_ok=True)
        (project / path).write_text(text, encoding="utf-8")
    with installed(project, folder / "site") as distribution:
        yield distribution


@pytest.fixture(scope="class")
def edited(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installed]:
    """A photodiode with a filter before it: one formula is another one."""
    formula = "counts = lux / LUX_PER_COUNT + self"
    edit = SENSOR, formula, "counts = 0.5 * lux / LUX_PER_COUNT + self"
    with new_sensor(tmp_path_factory.mktemp("edited"), edit) as distribution:
        yield distribution


@pytest.mark.usefixtures("edited")
class TestEditedSensor:
    def test_plugin_sensor_measures_according_to_its_formula(self, cubestack: Command) -> None:
        assert "largest error lux" in cubestack("measure", "glow", "--frames", "3")
        for frame in library.measure("glow", frames=5, seed=2):
            assert frame.as_dict()["measured_lux"] == pytest.approx(
                frame.as_dict()["truth_lux"] / 2, abs=80
            )

    def test_plugin_sensor_measures_a_scene_file(self, tmp_path: Path) -> None:
        (tmp_path / "dim.toml").write_text('kind = "light"\nlux = 1600\n')
        (frame,) = library.measure("glow", scene=tmp_path / "dim.toml")
        assert frame.as_dict()["truth_lux"] == 1600.0
        assert frame.as_dict()["measured_lux"] == pytest.approx(800, abs=80)

    def test_passes_the_protocol_suite(self, cubestack: Command) -> None:
        report = cubestack("conformance", "emulated:glow", "--allow-write")
        assert re.search(r"emulated:glow: \d\d passed, 0 failed, 0 skipped", report)

    def test_shell_commands_work_on_the_new_sensor(self, cubestack: Command) -> None:
        commands = "write Measure; time 0.1; read Light; power photodiode off"
        assert re.search(r"Count +1", cubestack("shell", "emulated:glow", "-c", commands))

    def test_has_a_derived_client(self) -> None:
        with library.open_device("glow") as glow:
            glow.client.set_samples(9)
            glow.client.set_samples(Samples=8)
            assert glow.client.settings() == {"Samples": 8}
            with pytest.raises(ValueError, match="SetSamples takes 1 values, not 2"):
                glow.client.set_samples(1, 2)
            with pytest.raises(ValueError, match="SetSamples needs a value for Samples"):
                glow.client.set_samples()

    def test_has_a_scene_form(self) -> None:
        keys = scenes.keys(device("glow"))["kinds"]["light"]
        assert (keys["lux"]["unit"], keys["lux"]["high"]) == ("lx", 150_000)
        with library.open_device("glow") as glow:
            glow.scene = replace(glow.scene, lux=3.0)
            shown = scenes.present(glow)
        assert shown["table"] == {"kind": "light", "lux": 3.0}
        assert shown["sight"]["fields"] == []

    def test_rejects_engines_and_other_scenes(self) -> None:
        with pytest.raises(ValueError, match="Glow has no FPGA; omit engine 'python'"):
            library.open_device("glow", engine="python")
        with (
            library.open_device("glow") as glow,
            pytest.raises(TypeError, match="a scene of Glow is a Scene, not 3"),
        ):
            glow.scene = 3

    def test_shares_a_bus_with_another_device(self) -> None:
        with (
            library.open_device("aramis") as aramis,
            library.open_device("glow", beside=aramis) as glow,
        ):
            assert aramis.smbus().read_byte_data(0x29, 128) == 0x29
            glow.client.measure()
            assert glow.client.light()["Illuminance"] == pytest.approx(10_000, abs=80)

    def test_is_listed_without_loading_its_board(self, edited: Installed) -> None:
        script = (
            "import sys; from cubestack.host.devices.registry import device;"
            "print(device('glow').title);"
            "print([m for m in sys.modules if m.startswith(('cubestack.emulator', 'numpy'))])"
        )
        done = edited.run(sys.executable, "-c", script)
        assert done.stdout.split() == ["Glow", "[]"], done.stderr


def test_tests_of_the_new_sensor_pass(tmp_path: Path) -> None:
    with new_sensor(tmp_path) as glow:
        tests = tmp_path / "glow-sensor" / "tests"
        done = forked(of_pytest("-q", *plugins(), tests), environment=glow.environment)
        assert done.code == 0, done.out


@pytest.mark.slow
def test_pip_installs_the_new_sensor(tmp_path: Path) -> None:
    python, target = sys.executable, tmp_path / "target"
    subprocess.run([python, "-m", "cubestack", "new-sensor", "glow"], cwd=tmp_path, check=True)
    options = ("-q", "--no-deps", "--no-build-isolation", "--target")
    install = [python, "-m", "pip", "install", *options, target, "./glow-sensor"]
    subprocess.run(install, cwd=tmp_path, check=True)
    measured = Installed((target,)).run(python, "-m", "cubestack", "measure", "glow", "--json")
    assert '"truth_lux"' in measured.stdout, measured.stderr


LIGHT = '"Light": lambda: {"Illuminance": self.illuminance, "Count": self.count}'
READING = (
    "            yield from cs.pause(CONVERSION_US)\n"
    '            total += yield cs.ReadPin("CONVERTER")\n'
)

MOST_LINES = 150


@pytest.mark.parametrize("name", ["glow", "m9_lux"])
def test_new_sensor_writes_a_small_folder_that_passes_the_linter(
    name: str, run: Run, tmp_path: Path
) -> None:
    folder = tmp_path / "sensor"
    outcome = run("new-sensor", name, "--out", folder)
    assert outcome.code == 0
    assert f"pip install --no-build-isolation -e {folder}" in outcome.out
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert {str(path.relative_to(folder)) for path in files} == {
        *("pyproject.toml", f"tests/test_{name}.py", f"{name}/__init__.py", f"{name}/sensor.py")
    }
    texts = [path.read_text(encoding="utf-8") for path in files]
    assert sum(len(text.splitlines()) for text in texts) <= MOST_LINES
    for command in (["check", "--select", "E,F,W,I,UP,B,SIM,RUF,C4,PT,N"], ["format", "--check"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--isolated", "--line-length", "100"]
        done = subprocess.run(ruff, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout


def test_new_sensor_folder_is_named_after_the_sensor(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("new-sensor", "glow").code == 0
    assert (tmp_path / "glow-sensor" / "glow" / "sensor.py").exists()
    outcome = run("new-sensor", "glow")
    assert (outcome.code, outcome.line) == (
        2,
        "cubestack new-sensor: glow-sensor exists; remove it, or choose another folder with --out",
    )


#: An edit, and the line that follows, with {text} for the number of the only line that has it.
MISTAKES: dict[str, tuple[Edit, str]] = {
    "telemetry_without_source": (
        (SENSOR, LIGHT, ""),
        r"sensor.py: Program.sources\(\) has no source of telemetry 140 Light; add 'Light'",
    ),
    "mistyped_source": (
        (SENSOR, '"Light": lambda', '"Lihgt": lambda'),
        r"sensor.py: Program.sources\(\) has 'Lihgt', .* no telemetry; did you mean Light\?",
    ),
    "mistyped_action": (
        (SENSOR, '"Measure": self', '"Mesure": self'),
        r"sensor.py: Program.actions\(\) has 'Mesure', .* no telecommand; did you mean Measure\?",
    ),
    "action_that_is_no_generator": (
        (SENSOR, READING, "            total += 1\n"),
        r"sensor.py:{def measure(self}: the action of telecommand Measure is no generator .*",
    ),
    "field_without_meaning": (
        (TABLES, '"Illuminance", "mean of the conversions", "lx"', '"Illuminance"'),
        r"glow:DEVICE: telemetry 140 Light: field Illuminance has no meaning; add a phrase .*",
    ),
    "message_without_meaning": (
        (TABLES, '"SetSamples", "set how much is averaged"', '"SetSamples"'),
        r"glow:DEVICE: telecommand 11 SetSamples has no meaning; add a phrase for a reader",
    ),
    "message_number_twice": (
        (TABLES, "Message(11,", "Message(10,"),
        r"__init__.py:{= node_interface(}: SetSamples: ID 10 is taken by Measure",
    ),
    "unknown_type": (
        (TABLES, 'u16("Count"', 'Field("u17", "Count"'),
        r"__init__.py:{u17}: .*name 'Field' is not defined",
    ),
    "reset_value_beyond_limits": (
        (TABLES, "reset=4", "reset=100"),
        r"__init__.py:{SetSamples}: message SetSamples: the reset value of Samples is out of range",
    ),
    "address_in_use": (
        (TABLES, "0x29", "0x1B"),
        r"glow:DEVICE: Glow: I2C address 0x1b is in use by CubeSense; choose another .*",
    ),
    "address_that_is_reserved": (
        (TABLES, "0x29", "0x05"),
        r"glow:DEVICE: Glow: I2C address 0x05 must be 0x08 to 0x77",
    ),
    "newer_version": (
        (TABLES, "written_for=1", "written_for=9"),
        r"glow: the interface cubestack.sensor has version 9, this program reads 1; .*",
    ),
    "unknown_cost": (
        (SENSOR, "f32_div=1", "f32_dvi=1"),
        r"sensor.py:{f32_dvi}: no operation 'f32_dvi' in the costs of .*; did you mean f32_div\?",
    ),
    "source_without_a_field": (
        (SENSOR, ', "Count": self.count}', "}"),
        r"sensor.py:{lambda}: the source of telemetry 140 Light must return .* not Illuminance",
    ),
    "telemetry_that_overflows": (
        (SENSOR, "np.float32(0), 0  #", "np.float32(0), 70_000  #"),
        r"sensor.py:{lambda}: telemetry 140 Light, field Count: 70000 does not fit; .*",
    ),
    "no_processor_in_the_supplies": (
        (SENSOR, '"processor": cs', '"procesor": cs'),
        r"sensor.py: supplies of Board need a part 'processor' with the currents .*",
    ),
    "no_costs": (
        (SENSOR, "    costs = cs.CORTEX_M3\n", ""),
        r"sensor.py: Board has no costs: the cost table of its processor, such as CORTEX_M3",
    ),
    "scene_without_kind": (
        (SENSOR, '    kind = "light"\n', ""),
        r"sensor.py:{class Scene}: Scene has no kind: what scene files have as `kind`",
    ),
    "mistyped_board": (
        (TABLES, "glow.sensor:Board", "glow.sensor:Bord"),
        r"glow.sensor:Bord does not load: .* no attribute 'Bord'",
    ),
}
WHILE_RUNNING: dict[str, tuple[Edit, str]] = {
    "telemetry_that_overflows_later": (
        (SENSOR, "(self.count + 1) % 0x10000", "self.count + 70_000"),
        r"sensor.py:{lambda}: telemetry 140 Light, field Count: 70000 does not fit; .*",
    ),
    "mistyped_setting": (
        (SENSOR, '"SetSamples", "Samples"', '"SetSample", "Samples"'),
        r"sensor.py:{SetSample}: no setting 'SetSample', 'Samples'; did you mean SetSamples\?",
    ),
    "mistyped_pin": (
        (SENSOR, 'ReadPin("CONVERTER")', 'ReadPin("CONVRTER")'),
        r"sensor.py:{CONVRTER}: this board has no FPGA, and no pin CONVRTER of its own",
    ),
    "routine_that_is_yielded": (
        (SENSOR, "yield from cs.pause", "yield cs.pause"),
        r"sensor.py:{yield cs.pause}: a program must yield a request, not <gen.* `yield from`",
    ),
}


def numbered(line: str, folder: Path) -> re.Pattern[str]:
    def number(found: re.Match[str]) -> str:
        texts = [text for text in sources if found[1] in text]
        assert len(texts) == 1
        return str(sources.index(texts[0]) + 1)

    file = TABLES if "__init__" in line else SENSOR
    sources = (folder / "glow-sensor" / file).read_text(encoding="utf-8").splitlines()
    return re.compile(re.sub(r"\{(.+?)\}", number, line) + "$")


@pytest.mark.parametrize("mistake", [*MISTAKES, *WHILE_RUNNING])
def test_mistake_in_the_declaration_or_the_firmware_is_one_line(
    mistake: str, run: Run, tmp_path: Path
) -> None:
    edit, line = (MISTAKES | WHILE_RUNNING)[mistake]
    commands: list[tuple[object, ...]] = [
        ("measure", "glow"),
        ("shell", "emulated:glow", "-c", "write Measure; time 0.1; read Light"),
    ]
    if mistake in MISTAKES:
        commands += [("emulate", "glow", "--pty", tmp_path / "tty")]
    with new_sensor(tmp_path, edit):
        for command in commands:
            outcome = run(*command)
            assert outcome.code == 2
            assert outcome.out == "" or mistake in WHILE_RUNNING
            (error,) = outcome.err.splitlines()
            assert numbered(line, tmp_path).search(error), error
        assert run("measure", "aramis", "--help").code == 0, "others are measured all the same"


def test_documented_edits_of_the_plugin_sensor_work(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "docs" / "how-to" / "adding-a-sensor.md").read_text(encoding="utf-8")
    formula, message = re.findall(r"```python\n(.*)\n```", text)
    (line,) = re.findall(r"^cubestack measure: .*", text, re.MULTILINE)
    assert formula in dict(rendered("glow"))[SENSOR]
    last = 'Message(141, "Settings", "what telecommands have set").of(SAMPLES),'
    imports = "import Message, f32"
    monkeypatch.chdir(tmp_path)
    edits = (TABLES, last, f"{last} {message}"), (TABLES, imports, "import Message, bool1, f32")
    with new_sensor(tmp_path, *edits):
        assert run("measure", "glow").line == line


def test_plugins_import_public_modules_only(tmp_path: Path) -> None:
    example = (ROOT / "examples" / "linear_sun_sensor" / "linear_sun_sensor").glob("*.py")
    texts = {str(path): path.read_text(encoding="utf-8") for path in example}
    texts |= {path: text for path, text in rendered("glow") if path.endswith(".py")}
    assert len(texts) > 10
    for path, text in texts.items():
        for node in ast.walk(ast.parse(text)):
            found = [node.module] if isinstance(node, ast.ImportFrom) else []
            found += [name.name for name in node.names] if isinstance(node, ast.Import) else []
            ours = {str(name) for name in found if str(name).split(".")[0] == "cubestack"}
            assert ours <= PUBLIC, f"{path} imports {ours - PUBLIC}"
