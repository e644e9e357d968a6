import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

import cubestack
import cubestack.sensor
from cubestack.host.cli.commands import commands, reports

ROOT = Path(__file__).parent.parent

DIAGRAMS = ("architecture.html", "sensors/sensor-cubesense.html")

LOADED = re.compile(
    r"<(?:script|img|iframe|source|video)[^>]*\ssrc=\"(https?:)?//"
    r"|<link[^>]*rel=\"?(?:stylesheet|preconnect|preload)[^>]*href=\"(https?:)?//"
)


built = pytest.mark.slow
"""Links and docstrings are tested quicker: tests/system/documents/test_pages.py, host/api."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built with every link checked."""
    folder = tmp_path_factory.mktemp("site")
    call = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(folder)]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1", "COLUMNS": "90"}
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, env=quiet)
    assert done.returncode == 0, done.stderr
    return folder


@built
def test_pages_load_nothing_from_other_hosts(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 40
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not LOADED.search(text), page.name
        assert 'data-md-component="source"' not in text  # which asks a host of repositories


def test_every_document_is_in_the_navigation() -> None:
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    named = set(re.findall(r": ([\w/-]+\.md)$", text, re.MULTILINE))
    pages = {str(path.relative_to(ROOT / "docs")) for path in (ROOT / "docs").rglob("*.md")}
    assert named == pages | {f"reference/{name}.md" for name in ("commands", "python", "sensor")}
    assert yaml.safe_load(text)["theme"]["font"] is False


@built
def test_commands_and_public_names_are_documented(site: Path) -> None:
    page = (site / "reference/commands.html").read_text(encoding="utf-8")
    subcommands = ("hdl-area", "hdl-wave", "measure-aramis", "calibrate-cubestar")
    for name in (*commands(), *reports(), *subcommands):
        assert f'id="cubestack-{name}"' in page
    for file, module in (("python", cubestack), ("sensor", cubestack.sensor)):
        names = (site / f"reference/{file}.html").read_text(encoding="utf-8")
        for name in (name for name in module.__all__ if not name.startswith("_")):
            assert f'id="{name.lower()}"' in names
        assert "\nNone\n</code>" not in names  # a docstring that is missing


@built
def test_site_search_works_from_the_file_system(site: Path, chromium: Any) -> None:
    page = chromium.new_page()
    page.goto(f"{(site / 'index.html').as_uri()}?q=pseudo-terminal")
    results = page.wait_for_selector(".md-search-result__item >> text=Serve a serial port")
    assert results is not None
    page.close()


@built
def test_page_that_runs_in_the_browser_is_reached_and_leads_back(site: Path) -> None:
    assert 'href="try/index.html"' in (site / "try.html").read_text(encoding="utf-8")
    assert 'href="../try.html"' in (site / "try/index.html").read_text(encoding="utf-8")
    assert not (site / "try/board").exists()


@built
@pytest.mark.parametrize("name", DIAGRAMS)
def test_diagrams_scroll_on_a_narrow_screen(site: Path, chromium: Any, name: str) -> None:
    page = chromium.new_page(viewport={"width": 390, "height": 800})
    page.goto((site / name).as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    widths = page.eval_on_selector_all(
        ".md-content img[src$='.svg']", "all => all.map(one => one.clientWidth)"
    )
    assert min(widths) >= 900
    page.close()
