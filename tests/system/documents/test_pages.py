import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.camera.common.hazards import HAZARDS as SENSOR_HAZARDS
from cubestack.emulator.camera.common.scene_file import load_scene
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS, UNCERTAIN
from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene
from cubestack.emulator.camera.ov7620.view import FisheyeCondition
from cubestack.emulator.ports.tcp import REFUSAL
from cubestack.emulator.scene.atmosphere import Atmosphere
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.file import DEVICE_KEYS
from cubestack.emulator.scene.hazards import EARTH_HAZARDS, SKY_HAZARDS
from cubestack.emulator.scene.hazards.hazard import Hazard
from cubestack.emulator.scene.sky import SceneError, SkyScene
from cubestack.firmware_model.cubesense.memory import Memory, budget, used
from cubestack.firmware_model.interface.aramis import Reason
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.host.cli.main import make_parser
from cubestack.host.devices.registry import devices
from tests.conftest import Run
from tests.system.conftest import ROOT
from tests.together import together

EARTH, BALL = 'kind = "earth-sun"', 'kind = "ball"'


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def load(folder: Path, text: str) -> Any:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return (
        load_earth_sun_scene(path)
        if EARTH in text or BALL in text
        else load_scene(path, CONDITION, UNCERTAIN)
    )


def section(text: str, heading: str) -> str:
    return text.split(f"## {heading}\n")[1].split("\n## ")[0]


@pytest.mark.parametrize(
    ("heading", "scene"),
    [
        ('Keys of `kind = "sky"`', 'kind = "sky"'),
        ("Keys of `poses`", 'kind = "sky"\nra_deg = 1\ndec_deg = 1\n[[poses]]'),
        ("Keys of `atmosphere`", 'kind = "sky"\nra_deg = 1\ndec_deg = 1\n[atmosphere]'),
        ("Keys of `optics`", 'kind = "sky"\nra_deg = 1\ndec_deg = 1\n[optics]'),
        ('Keys of `kind = "picture"`', 'kind = "picture"'),
        ('Keys of `kind = "earth-sun"`', EARTH),
        ('Keys of `kind = "ball"`', BALL),
        ("Keys of `nadir_camera` and `sun_camera`", f"{EARTH}\n[nadir_camera]"),
        ("Keys of `nadir_lens` and `sun_lens`", f"{EARTH}\n[sun_lens]"),
        ("Keys of `reflections`", f"{EARTH}\n[[reflections]]"),
    ],
)
def test_every_key_of_a_scene_is_documented(tmp_path: Path, heading: str, scene: str) -> None:
    part = section(text_of("docs/reference/scene-keys.md"), heading)
    firsts = [row.split("|")[1] for row in part.splitlines() if row.startswith("| `")]
    with pytest.raises(SceneError, match="unknown key 'colour'; allowed are") as raised:
        load(tmp_path, f"{scene}\ncolour = 1")
    allowed = set(str(raised.value).split("allowed are ")[1].split(", "))
    assert set(re.findall(r"`(\w+)`", " ".join(firsts) or part)) == allowed


@pytest.mark.parametrize(
    ("heading", "defaults"),
    [
        ("Keys of `atmosphere`", (Atmosphere(0, 0),)),
        ("Keys of `optics`", (LENS,)),
        ('Keys of `kind = "sky"`', (SkyScene.pointing(0, 0), CONDITION)),
        ('Keys of `kind = "earth-sun"`', (EarthSunScene(), FisheyeCondition())),
    ],
)
def test_documented_defaults_match_the_code(heading: str, defaults: tuple[object, ...]) -> None:
    part = section(text_of("docs/reference/scene-keys.md"), heading)
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
    assert checked >= 3


def hazard_rows(hazard: type[Hazard]) -> list[str]:
    """Table rows of all keys of a hazard except the seed."""
    rows = []
    for name, one in hazard.declared().items():
        value = one.default
        if isinstance(value, tuple):
            shown = str([float(f"{number:g}") for number in value]).replace(".0", "")
        else:
            shown = f"{value:.10g}" if isinstance(value, int | float) else str(value or "none")
        span = one.limits or " or ".join(one.choice_values) or one.unit
        if name != "seed":
            rows.append(f"| `{hazard.name}` | `{name}` | {shown} | {span} | {one.meaning} |")
    return rows


def test_every_key_of_every_hazard_is_documented() -> None:
    part = section(text_of("docs/reference/scene-keys.md"), "Keys of `hazards`")
    light = [*SKY_HAZARDS.values(), *EARTH_HAZARDS.values()]
    hazards: list[type[Hazard]] = [*light, *SENSOR_HAZARDS.values()]
    expected = [row for hazard in hazards for row in hazard_rows(hazard)]
    assert [row for row in part.splitlines() if row.startswith("| `")] == expected


def test_hazard_curves_have_all_strengths() -> None:
    page = text_of("docs/hazards.md")
    for hazard in (*SKY_HAZARDS.values(), *EARTH_HAZARDS.values(), *SENSOR_HAZARDS.values()):
        part = section(page, hazard.name)
        assert f"`--hazard {hazard.name}`, which is `{hazard.name}=" in part
        (usual,) = re.findall(rf"which is `{hazard.name}=(.*?)`", part)
        assert float(usual) == hazard.strength.usual
        shown: dict[str, list[float]] = {}
        for device, strength in re.findall(r"^\| (\w+) \| (\S+) \| \d", part, re.MULTILINE):
            shown.setdefault(device, []).append(float(strength))
        assert shown
        assert all(scale == [*hazard.strength.values] for scale in shown.values()), hazard.name


def test_examples_of_scenes_load(tmp_path: Path) -> None:
    examples = re.findall(r"```toml\n(.*?)```", text_of("docs/how-to/scenes.md"), re.DOTALL)
    sky, night, hard, picture, earth, ball, device = examples
    scene = load(tmp_path, device + sky).scene
    assert {*tomllib.loads(device)} == {*DEVICE_KEYS}
    assert isinstance(scene, SkyScene)
    assert len(scene.poses) == 1
    ground = load(tmp_path, night).scene
    assert isinstance(ground, SkyScene)
    assert ground.atmosphere is not None
    view = load(tmp_path, hard)
    assert [hazard.name for hazard in view.scene.hazards] == ["moon", "debris", "debris"]
    assert [hazard.name for hazard in view.condition.hazards] == ["hot-pixels"]
    assert len(load(tmp_path, earth).scene.reflections) == 1
    assert load(tmp_path, ball).scene.glow_km == 0
    assert tomllib.loads(picture)["kind"] == "picture"
    with pytest.raises(SceneError, match=r"night\.jpg"):  # read, but there is no such file here
        load(tmp_path, picture)


#: Every document for people; of examples their own pages.
DOCUMENTS = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "examples").glob("*/README.md")),
]


def anchors(path: Path) -> set[str]:
    """Anchors of the headings, as GitHub and the site make them."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    plain = (re.sub(r"[^\w\s-]", "", heading.lower()).strip() for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


def test_links_point_to_files_and_headings() -> None:
    checked = 0
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        for target, anchor in re.findall(r"\]\(([^)#:]*)(?:#([^)]+))?\)", text):
            page = document.parent / target if target else document
            assert page.exists(), f"{document.name}: {target}"
            if anchor:
                assert anchor in anchors(page), f"{document.name}: {target}#{anchor}"
                checked += 1
    assert checked > 5


#: A path in backticks, from the root of the repository or from the document's folder.
PATH = re.compile(r"`((?:docs|emulator|examples|firmware_model|hdl|host|tests)/[\w/.*?-]*)")


@together("document", DOCUMENTS, ids=lambda path: path.name)
def test_files_that_a_document_names_exist(document: Path) -> None:
    named = PATH.findall(document.read_text(encoding="utf-8"))
    folders = ROOT, document.parent
    assert [path for path in named if not any(any(one.glob(path)) for one in folders)] == []


@pytest.mark.parametrize("package", ["hdl", "firmware_model", "emulator", "host"])
def test_architecture_page_names_every_folder(package: str) -> None:
    (row,) = re.findall(rf"^\| `{package}/` \|.*", text_of("docs/architecture.md"), re.MULTILINE)
    folders = {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    assert folders <= set(re.findall(r"`(\w+)/`", row))


def test_readme_has_at_most_600_words() -> None:
    assert len(text_of("README.md").split()) <= 600


def test_makefile_has_the_documented_targets() -> None:
    targets = set(re.findall(r"^(\w+):", text_of("Makefile"), re.MULTILINE))
    assert {"venv", "run", "test", "lint", "bench", "clean"} <= targets
    assert set(re.findall(r"^make (\w+)", text_of("README.md"), re.MULTILINE)) <= targets


@pytest.mark.parametrize(
    ("name", "device", "measured", "others"),
    [
        ("fidelity", "cubestar", 1, 0),
        ("fidelity-cubesense", "cubesense", 4, 0),
        ("fidelity-aramis", "aramis", 4, 2),
    ],
)
def test_commands_and_files_of_the_fidelity_pages_exist(
    name: str, device: str, measured: int, others: int
) -> None:
    page = text_of(f"docs/{name}.md")
    commands = re.findall(rf"`measure (?:{device} )?(--[^`]+)`", page)
    assert len(commands) >= measured
    for command in commands:
        make_parser("measure").parse_args(["measure", device, "--json", *command.split()])
    commands = re.findall(r"`\.venv/bin/cubestack ((?!measure)\w[^`]*)`", page)
    assert len(commands) >= others
    for command in commands:
        make_parser(command.split()[0]).parse_args(command.split())
    files = re.findall(r"`(\w+/[\w/]+\.py)`", page)
    files += [
        f"{module.replace('.', '/')}.py" for module in re.findall(r"`python -m ([\w.]+)", page)
    ]
    for file in files:
        assert (ROOT / file).is_file(), file


def test_documented_reads_that_act_match_the_tables() -> None:
    rows = section(text_of("docs/reference/i2c-bus.md"), "Reads that act").splitlines()
    for device in devices():
        found = [
            ", ".join(f"{one.id} {one.name}" for one in messages if one.supported) or "none"
            for messages in (
                [one for one in device.interface.telecommands if not one.length],
                [one for one in device.interface.telemetries if one.has_side_effect],
            )
        ]
        assert f"| {device.title} | {found[0]} | {found[1]} |" in rows


def test_refusal_of_a_second_client_is_documented() -> None:
    page = text_of("docs/how-to/serial-ports.md")
    assert REFUSAL.decode().strip() in section(page, "A second client")


def test_reasons_on_the_aramis_page_exist() -> None:
    named = re.findall(r"`([A-Z_]{5,})`", text_of("docs/fidelity-aramis.md"))
    assert {*named} <= Reason.__members__.keys()


def test_memory_of_cubesense_is_documented(run: Run) -> None:
    table = run("memory", "cubesense", "--profile", "published").out
    ram, flash = re.findall(r"\*\*all, of \d+\*\* \| \*\*(\d+)", table)
    page = text_of("docs/reference/switches.md")
    assert f"{ram} of 1536 bytes of RAM in use, and {flash} bytes" in page
    extended = used(budget(CubeSenseSwitches.of("extended")))[Memory.RAM]
    assert f"{extended} of 1536 bytes" in text_of("docs/fidelity-cubesense.md")
