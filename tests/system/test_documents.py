"""What documents say, against what is there."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.boards.cubesense.power import CUBESENSE_POWER
from cubestack.emulator.camera.common.scene_file import load_scene
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene
from cubestack.emulator.camera.ov7620.view import FisheyeCondition
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SceneError, SkyScene
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.cubesense.memory import Memory, budget, used
from cubestack.firmware_model.interface.aramis import Reason
from cubestack.host.cli.main import COMMANDS, make_parser
from cubestack.host.cli.reports import reports

BLOCK = re.compile(r"```toml\n(.*?)```", re.DOTALL)
EARTH = 'kind = "earth-sun"\n'
LINK = re.compile(r"\]\(([^)#:]+)\)")


def load(path: Path) -> Any:
    """What the scene file ``path`` gives."""
    if EARTH in path.read_text(encoding="utf-8"):
        return load_earth_sun_scene(path)
    return load_scene(path, CONDITION)


def section(text: str, heading: str) -> str:
    """The part of a Markdown text below a heading."""
    return text.split(f"## {heading}\n")[1].split("\n## ")[0]


def allowed_keys(tmp_path: Path, scene: str) -> set[str]:
    """Keys that a reader of scenes names when it meets one that it does not know."""
    path = tmp_path / "scene.toml"
    path.write_text(scene, encoding="utf-8")
    with pytest.raises(SceneError, match="unknown key 'colour'; allowed are") as raised:
        load(path)
    return set(str(raised.value).split("allowed are ")[1].split(", "))


@pytest.mark.parametrize(
    ("heading", "scene"),
    [
        ('Keys of `kind = "sky"`', 'kind = "sky"\ncolour = 1'),
        ("Keys of `poses`", 'kind = "sky"\nra_deg = 1\ndec_deg = 1\n[[poses]]\ncolour = 1'),
        ("Keys of `optics`", 'kind = "sky"\nra_deg = 1\ndec_deg = 1\n[optics]\ncolour = 1'),
        ('Keys of `kind = "picture"`', 'kind = "picture"\ncolour = 1'),
        ('Keys of `kind = "earth-sun"`', 'kind = "earth-sun"\ncolour = 1'),
        ("Keys of `nadir_camera` and `sun_camera`", f"{EARTH}[nadir_camera]\ncolour = 1"),
        ("Keys of `reflections`", f"{EARTH}[[reflections]]\ncolour = 1"),
    ],
)
def test_every_key_of_a_scene_is_documented(
    root: Path, tmp_path: Path, heading: str, scene: str
) -> None:
    part = section((root / "docs" / "scenes.md").read_text(encoding="utf-8"), heading)
    firsts = [row.split("|")[1] for row in part.splitlines() if row.startswith("| `")]
    documented = set(re.findall(r"`(\w+)`", " ".join(firsts) or part))
    assert documented == allowed_keys(tmp_path, scene)


@pytest.mark.parametrize(
    ("heading", "defaults"),
    [
        ("Keys of `optics`", (LENS,)),
        ('Keys of `kind = "sky"`', (SkyScene.pointing(0, 0), CONDITION)),
        ('Keys of `kind = "earth-sun"`', (EarthSunScene(), FisheyeCondition())),
    ],
)
def test_defaults_are_those_of_the_code(
    root: Path, heading: str, defaults: tuple[object, ...]
) -> None:
    part = section((root / "docs" / "scenes.md").read_text(encoding="utf-8"), heading)
    checked = 0
    for row in part.splitlines():
        cells = [cell.strip() for cell in row.split("|")]
        keys = re.findall(r"`(\w+)`", cells[1]) if row.startswith("| `") else []
        values = re.findall(r"^-?[\d.]+$", cells[2].replace(", ", "\n"), re.M) if keys else []
        for key, value in zip(keys, values, strict=False):
            owner = next((owner for owner in defaults if hasattr(owner, key)), None)
            default = getattr(owner, key, None)
            if isinstance(default, int | float):
                assert default == float(value), key
                checked += 1
    assert checked >= 4


def test_examples_of_scenes_load(root: Path, tmp_path: Path) -> None:
    sky, picture, earth = BLOCK.findall((root / "docs" / "scenes.md").read_text(encoding="utf-8"))
    path = tmp_path / "scene.toml"
    path.write_text(sky, encoding="utf-8")
    scene = load(path).scene
    assert isinstance(scene, SkyScene)
    assert len(scene.poses) == 1
    path.write_text(earth, encoding="utf-8")
    assert len(load(path).scene.reflections) == 1
    assert tomllib.loads(picture)["kind"] == "picture"
    path.write_text(picture, encoding="utf-8")
    with pytest.raises(SceneError, match=r"night\.jpg"):  # read, but there is no such file here
        load(path)


def test_links_lead_somewhere(root: Path) -> None:
    documents = [root / "README.md", *sorted((root / "docs").glob("*.md"))]
    for document in documents:
        for target in LINK.findall(document.read_text(encoding="utf-8")):
            assert (document.parent / target).exists(), f"{document.name}: {target}"


def test_make_has_the_targets_that_are_promised(root: Path) -> None:
    makefile = (root / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^(\w+):", makefile, re.MULTILINE))
    promised = {"venv", "run", "test", "lint", "bench", "clean"}
    assert promised <= targets
    readme = (root / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^make (\w+)", readme, re.MULTILINE)) <= targets


def test_commands_of_the_readme_exist(root: Path) -> None:
    readme = (root / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^(?:\.venv/bin/)?cubestack (\w+)", readme, re.MULTILINE))
    assert named <= {*COMMANDS, *reports()}


@pytest.mark.parametrize(
    ("name", "device", "measured", "others"),
    [
        ("fidelity", "cubestar", 5, 0),
        ("fidelity-cubesense", "cubesense", 7, 0),
        ("fidelity-aramis", "aramis", 7, 2),
    ],
)
def test_commands_and_files_of_the_fidelity_pages_exist(
    root: Path, name: str, device: str, measured: int, others: int
) -> None:
    page = (root / "docs" / f"{name}.md").read_text(encoding="utf-8")
    commands = re.findall(r"`measure (--[^`]+)`", page)
    assert len(commands) >= measured
    for command in commands:
        make_parser().parse_args(["measure", device, "--json", *command.split()])
    commands = re.findall(r"`\.venv/bin/cubestack ((?!measure)\w[^`]*)`", page)
    assert len(commands) >= others
    for command in commands:
        make_parser().parse_args(command.split())
    files = re.findall(r"`(\w+/[\w/]+\.py)`", page)
    files += [
        f"{module.replace('.', '/')}.py" for module in re.findall(r"`python -m ([\w.]+)", page)
    ]
    for file in files:
        assert (root / file).is_file(), file


def test_experiments_of_the_fidelity_page_are_those_there_are(root: Path) -> None:
    page = (root / "docs" / "fidelity.md").read_text(encoding="utf-8")
    experiments = (root / "tests" / "system" / "experiments.py").read_text(encoding="utf-8")
    named = set(re.findall(r"`experiments\.py (\w+)", page))
    assert named == set(re.findall(r"experiments\.py (\w+) ", experiments))


def test_reasons_of_aramis_page_are_those_of_the_interface(root: Path) -> None:
    page = (root / "docs" / "fidelity-aramis.md").read_text(encoding="utf-8")
    for name in re.findall(r"`([A-Z_]{5,})`", page):
        assert name in Reason.__members__, name


def test_figures_of_cubesense_s_page(root: Path) -> None:
    page = (root / "docs" / "fidelity-cubesense.md").read_text(encoding="utf-8")
    assert f"{used(budget())[Memory.RAM]} of 1536 bytes" in page
    rows = section(page, "Power (table 7.1)").splitlines()
    states = [[cell.strip() for cell in row.split("|")[1:8]] for row in rows if row.endswith("% |")]
    counts = {"off": 0, "one": 1, "both": 2, "": 0, "one side": 1, "both sides": 2}
    compared = 0
    for processor, *parts, published, ours, _ in states:
        memories, cameras, sides = (counts[part] for part in parts)
        power = PowerModel(Kernel(), CUBESENSE_POWER)
        power.set_state("processor", "on" if processor == "on" else "reset")
        for half, (number, side) in enumerate((("1", "sun"), ("2", "nadir"))):
            power.switch(f"SRAM{number}", half < memories)
            power.switch(f"{side}_camera", half < cameras)
            if half < sides:
                power.set_state(f"sram{number}", "active")
                power.set_state(f"{side}_fpga", "imaging")
        milliwatts = power.current_ma() * CUBESENSE_POWER.volts
        assert milliwatts == pytest.approx(float(ours), abs=0.06)
        assert milliwatts == pytest.approx(float(published), rel=0.06)
        compared += 1
    assert compared == 8
