"""This process's limit of descriptors, of which each opened device file needs one."""

import contextlib
import resource

RESERVE = 16
"""Descriptors that are left for everything else."""


def has_room(descriptor: int) -> bool:
    """Whether the new ``descriptor`` leaves ``RESERVE`` ones; raises the soft limit if it can."""
    return descriptor < _soft_limit() - RESERVE or (
        raise_limit() and descriptor < _soft_limit() - RESERVE
    )


def raise_limit() -> bool:
    """Raise the soft limit to the hard one; returns whether it was lower."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == hard:
        return False
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return _soft_limit() != soft


def _soft_limit() -> int:
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return 1 << 30 if soft == resource.RLIM_INFINITY else soft
