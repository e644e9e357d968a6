"""The style of all diagrams: light, and dark where the reader prefers that."""

from collections.abc import Mapping

LIGHT = {
    "text": "fill:#111",
    ".soft": "fill:#555",
    ".paper": "fill:#fff",
    ".box": "fill:#eef3fb;stroke:#1a4f9c",
    ".line": "stroke:#333",
    ".head": "fill:#333",
    ".wave": "stroke:#1a4f9c",
    ".grid": "stroke:#ddd",
}
DARK = {
    "text": "fill:#e8e8e8",
    ".soft": "fill:#b4b8c2",
    ".paper": "fill:#1e2129",
    ".box": "fill:#22324d;stroke:#7da7e8",
    ".line": "stroke:#b4b8c2",
    ".head": "fill:#b4b8c2",
    ".wave": "stroke:#8ab4f8",
    ".grid": "stroke:#3d424e",
}


def head(
    width: float,
    height: float,
    shapes: str,
    light: Mapping[str, str] | None = None,
    dark: Mapping[str, str] | None = None,
) -> list[str]:
    """The beginning of an SVG: its size in px, its style, and its paper.

    ``shapes`` is CSS that both colour schemes share; ``light`` and ``dark`` are further rules of
    each, by selector.
    """
    usual, night = _rules(LIGHT | (light or {})), _rules(DARK | (dark or {}))
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
        f'font-family="sans-serif"><style>{usual}{shapes}'
        f"@media(prefers-color-scheme:dark){{{night}}}</style>",
        f'<rect class="paper" width="{width:g}" height="{height:g}"/>',
    ]


def _rules(rules: Mapping[str, str]) -> str:
    return "".join(f"{selector}{{{declaration}}}" for selector, declaration in rules.items())
