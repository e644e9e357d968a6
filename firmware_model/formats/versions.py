"""Versions of what is stored or spoken: files, folders and protocols.

Each has a whole number that is raised when an older program could misread it.
"""

from collections.abc import Collection


def check_version(what: str, found: object, known: Collection[int]) -> int:
    """``found`` if it is one of the ``known`` versions of ``what``; raises ValueError otherwise."""
    if isinstance(found, int) and not isinstance(found, bool):
        if found in known:
            return found
        readable = " and ".join(map(str, sorted(known)))
        advice = "update cubestack" if found > max(known) else f"make the {what} again"
        raise ValueError(f"the {what} has version {found}, this program reads {readable}; {advice}")
    raise ValueError(f"the version of the {what} must be a whole number, not {found!r}")
