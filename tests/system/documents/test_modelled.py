"""What architecture.md lists as modelled: the registered hazards, faults and switches. No page
denies one of them."""

import re
from collections.abc import Iterator

from cubestack.emulator.faults.table import FAULTS
from cubestack.firmware_model.interface.codec.switches import Switches
from cubestack.host.devices.registry import BUILT_IN, device
from cubestack.host.experiments.hazard_options import known
from tests.system.conftest import ROOT

BEGIN, END = "<!-- generated from hazards, faults and switches -->\n", "<!-- end -->\n"


def modelled() -> str:
    """The list of the page."""
    switches = {
        device(name).title: ", ".join(f"`{one}`" for one in names_of(device(name).switches))
        for name in BUILT_IN
    }
    return "\n".join(
        (
            f"- Hazards of skies, lenses and pixels ([hazards.md](hazards.md)): {listed(known())}",
            f"- Faults ([fault-kinds.md](reference/fault-kinds.md)): {listed(FAULTS)}",
            "- Switches between published and better ([switches.md](reference/switches.md)): "
            f"{'; '.join(f'{title} {names}' for title, names in switches.items())}",
        )
    )


def names_of(switches: type[Switches]) -> list[str]:
    return list(switches.declared())


def listed(names: object) -> str:
    return ", ".join(f"`{name}`" for name in sorted(names))  # type: ignore[call-overload]


def test_architecture_lists_what_is_modelled() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    assert page.split(BEGIN)[1].split(END)[0].strip() == modelled()


# --- denials --------------------------------------------------------------------------------------

DENIAL = re.compile(
    r"\b(?:not|nor|never|neither)\b(?:\W+\w+){0,3}\W+"
    r"(?:modelled|emulated|simulated|included|implemented|reproduced|covered)\b|\bno models? of\b",
    re.IGNORECASE,
)

RIGHT = {
    (
        "reference/switches.md",
        "aberration",
    ): "a tracker's claimed covariance leaves it out; the hazard adds it to the sky"
}
"""Page and name, and why its denial is true."""


def denials(text: str) -> Iterator[str]:
    """Sentences that deny; and, below a heading that does, what bullets begin with, unless they
    link to the pages of hazards and faults."""
    text = re.sub(r"^```.*?^```|<!--.*?-->", "", text, flags=re.DOTALL | re.MULTILINE)
    for section in re.split(r"^(?=#)", text, flags=re.MULTILINE):
        for part in re.split(r"(?<=[.;])\s|\n\n|^- |^\|", section, flags=re.MULTILINE):
            if DENIAL.search(part):
                yield part
        heading, _, body = section.partition("\n")
        if heading.startswith("#") and DENIAL.search(heading):
            for bullet in re.split(r"^- ", body, flags=re.MULTILINE)[1:]:
                if not re.search(r"\((how-to/faults|hazards)\.md", bullet):
                    yield bullet.partition("**")[2].partition("**")[0]


def denied(text: str) -> Iterator[str]:
    """Names of hazards and faults in the denials of a page."""
    for part in denials(text):
        plain = re.sub(r"[\s`-]+", " ", part.lower())
        for name in {*known(), *FAULTS}:
            if re.search(rf"\b{name.replace('-', ' ')}s?\b", plain):
                yield name


def test_denials_of_registered_names_are_found() -> None:
    text = (
        "A. Neither the Moon nor clouds are modelled.\n\n## Not emulated\n\n- **Sun glare**: x.\n"
    )
    assert sorted(denied(text)) == ["clouds", "moon", "sun-glare"]
    assert not list(denied("The Moon is modelled. Temperature is not modelled.\n"))


def test_no_page_denies_what_is_registered() -> None:
    found = {
        (path.relative_to(ROOT / "docs").as_posix(), name)
        for path in (ROOT / "docs").rglob("*.md")
        for name in denied(path.read_text("utf-8"))
    }
    assert found == set(RIGHT)
