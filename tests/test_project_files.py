import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement

from cubestack.host.native.wheels import PLATFORMS

ROOT = Path(__file__).parent.parent


def project() -> dict[str, Any]:
    own: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return own


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_version_is_the_same_everywhere() -> None:
    version = project()["version"]
    releases = re.findall(r"^## (\d.*?) - (\d{4}-\d\d-\d\d)$", text_of("CHANGELOG.md"), re.M)
    citation = yaml.safe_load(text_of("CITATION.cff"))
    assert releases[0] == (version, str(citation["date-released"]))
    assert citation["version"] == version
    assert citation["license"] == project()["license"]
    assert releases == sorted(releases, key=lambda one: one[1], reverse=True)


def test_changelog_has_the_usual_headings() -> None:
    kinds = set(re.findall(r"^### (.*)$", text_of("CHANGELOG.md"), re.M))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def workflows() -> Iterator[tuple[str, Any]]:
    for path in sorted((ROOT / ".github" / "workflows").glob("*.yml")):
        yield path.name, yaml.safe_load(path.read_text())
    page = "docs/how-to/ci.md"
    blocks = re.findall(r"```yaml\n(.*?)```", text_of(page), re.DOTALL)
    yield from ((f"{page}, {number}", yaml.safe_load(one)) for number, one in enumerate(blocks))


def commands(workflow: Any) -> Iterator[str]:
    """Shell commands of a GitHub or GitLab workflow, one by one."""
    jobs = workflow.get("jobs", workflow).values()
    for job in (job for job in jobs if isinstance(job, dict)):
        steps = [step.get("run", "") for step in job.get("steps", ())] + job.get("script", [])
        yield from (part.strip() for step in steps for part in re.split("&&|\n", step))


@pytest.mark.parametrize(("name", "workflow"), list(workflows()))
def test_workflows_use_existing_targets(name: str, workflow: Any) -> None:
    targets = re.findall(r"^([\w-]+):", text_of("Makefile"), re.M)
    extras = project()["optional-dependencies"]
    found = list(commands(workflow))
    assert len(found) > 5
    for words in (command.split() for command in found):
        if words[:1] == ["make"]:
            assert words[1] in targets
    for named in re.findall(r"cubestack\[(.*?)\]", " ".join(found)):
        assert set(named.split(",")) <= set(extras)
    for platform in re.findall(r"(?:many|musl)linux_\w+|macosx_\w+", str(workflow)):
        assert platform in PLATFORMS
    for address in re.findall(r"https://github.com/[\w/.-]+", str(workflow)):
        assert address == project()["urls"]["Repository"]


def test_pytest_options_of_the_workflows_exist() -> None:
    call = [sys.executable, "-m", "pytest", "--help"]
    known = subprocess.run(call, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    for option in set(re.findall(r"--cubestack-[\w-]+", text_of("docs/how-to/ci.md"))):
        assert option in known


@pytest.mark.slow
def test_documented_ci_measurement_succeeds(run: Any) -> None:
    (words,) = {
        one.partition("cubestack ")[2]
        for name, workflow in workflows()
        if name.startswith("docs/")
        for one in commands(workflow)
        if one.startswith("cubestack measure") and "--gateware" not in one
    }
    assert run(*words.split()).code == 0


def test_docker_image_is_built_from_the_tree() -> None:
    lines = text_of("Dockerfile").splitlines()
    assert [line for line in lines if line.startswith("COPY")] == [
        "COPY . /source",
        "COPY --from=build /opt/cubestack /opt/cubestack",
    ]
    assert lines.index("USER cubestack") < lines.index('ENTRYPOINT ["cubestack"]')
    extras = set(re.findall(r"\[(\w+)\](?: @ file|\")", text_of("Dockerfile")))
    assert extras == {"ground", "release"} <= set(project()["optional-dependencies"])


def test_no_page_installs_from_an_index() -> None:
    by_name = re.compile(r"pip install\b[^\n]*?[ \"']cubestack(?:\[[\w,]+\])?(?![\[\w/.-]| @ )")
    assert by_name.search("pip install pytest 'cubestack[hdl]'")
    texts = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("examples/**/*.md")]
    texts += [path for name in ("emulator", "hdl", "host") for path in ROOT.glob(f"{name}/**/*.py")]
    assert not [path for path in texts if by_name.search(path.read_text("utf-8"))]


def locked() -> dict[str, tuple[str, list[str]]]:
    """Version and hashes by package of the development environment's lock file."""
    text = text_of("requirements-dev.txt").replace("\\\n", " ")
    lines = [line.split() for line in text.splitlines() if line and not line.startswith("#")]
    return {
        words[0].partition("==")[0]: (words[0].partition("==")[2], words[1:]) for words in lines
    }


def required(extra: str) -> Iterator[Requirement]:
    names = project()["dependencies"] if not extra else project()["optional-dependencies"][extra]
    for requirement in map(Requirement, names):
        if requirement.name == "cubestack":
            for more in requirement.extras:
                yield from required(more)
        else:
            yield requirement


def test_lock_file_has_all_that_make_test_needs_with_hashes() -> None:
    found = locked()
    for requirement in (*required(""), *required("dev"), *required("hdl")):
        assert requirement.name in found, f"{requirement.name} is not locked: see CONTRIBUTING.md"
        assert requirement.specifier.contains(found[requirement.name][0]), requirement
    for name, (version, hashes) in found.items():
        assert version, name
        assert hashes, name
        assert all(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}", one) for one in hashes), name


def test_lock_file_names_no_place() -> None:
    assert not re.search(r"https?://|index-url|@", text_of("requirements-dev.txt"))


def test_promises_of_security_name_existing_tests() -> None:
    rows = [line for line in text_of("SECURITY.md").splitlines() if line.startswith("|")][2:]
    for row in rows:
        paths = re.findall(r"`(tests/[\w/.]+)`", row)
        assert paths, row
        assert all((ROOT / path).exists() for path in paths), row


def test_compiler_that_makes_loaded_code_is_pinned() -> None:
    (zig,) = (one for one in required("compiler") if one.name == "ziglang")
    assert str(zig.specifier).startswith("==")
    assert [one for one in required("release") if one.name == "ziglang"] == [zig]
