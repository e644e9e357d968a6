import hashlib
import tomllib

from cubestack.host.ground.page_app import PAGE

VENDOR = PAGE / "vendor"


def test_vendored_files_match_their_listed_sources() -> None:
    sources = tomllib.loads((VENDOR / "sources.toml").read_text(encoding="utf-8"))
    sums = {name: one for source in sources.values() for name, one in source["sha256"].items()}
    found = {path.name: path.read_bytes() for path in VENDOR.iterdir()}
    del found["sources.toml"]
    assert {name: hashlib.sha256(text).hexdigest() for name, text in found.items()} == sums
    version = sources["uplot"]["version"]
    assert f"(v{version})".encode() in found["uPlot.iife.min.js"]
    assert f"-{version}.tgz" in sources["uplot"]["package"]
    assert b"The MIT License" in found["uPlot.LICENSE"]
