"""Script text in every text that a device, file or program sends."""

from typing import Any

HOSTILE = "<img src=x onerror=document.hacked=1>"

ASKED_WITH = ("type", "frame", "field", "access", "what")
"""Members that the page interprets and does not show."""

NAMED = ("currents_ma", "probes", "snapshots", "pictures", "bits")
"""Members whose keys are names of the device."""


def hostile(value: Any) -> Any:
    """``value`` with script text appended to every text and name."""
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
