"""Script text in place of every text that a device, a file or a program tells."""

from typing import Any

HOSTILE = "<img src=x onerror=document.hacked=1>"

ASKED_WITH = ("type", "frame", "field", "access", "what")
"""Members whose text the page understands, and does not show."""

NAMED = ("currents_ma", "probes", "snapshots", "pictures", "bits")
"""Members that have names of the device for keys."""


def hostile(value: Any) -> Any:
    """The same with script text behind every text, names among them."""
    if isinstance(value, dict):
        return {
            key: one
            if key in ASKED_WITH
            else {name + HOSTILE: hostile(each) for name, each in one.items()}
            if key in NAMED and isinstance(one, dict)
            else hostile(one)
            for key, one in value.items()
        }
    if isinstance(value, list):
        return [hostile(one) for one in value]
    return value + HOSTILE if isinstance(value, str) else value
