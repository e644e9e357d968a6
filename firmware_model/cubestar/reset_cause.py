"""Meaning of the EFM32GG's reset-cause register: its bits stay until the program clears them.

The published list has numbers for two pairs of causes. The rest is assumed: a cause that includes a
rise of the supply hides all others, and any other combination is undetermined.
"""

from collections.abc import Collection

from cubestack.firmware_model.interface.cubestar.codes import ResetCause

_SUPPLY = (ResetCause.POWER_ON, ResetCause.BROWN_OUT_UNREGULATED, ResetCause.BROWN_OUT_REGULATED)
_MEANINGS: dict[frozenset[int], ResetCause] = {
    **{frozenset({one}): one for one in ResetCause},
    frozenset({ResetCause.EXTERNAL_PIN, ResetCause.WATCHDOG}): ResetCause.EXTERNAL_OR_WATCHDOG,
    frozenset({ResetCause.LOCKUP, ResetCause.SYSTEM_REQUEST}): ResetCause.LOCKUP_OR_SYSTEM_REQUEST,
}


def cause_of(bits: Collection[int]) -> ResetCause:
    """The published number of the set bits, each given by its own number."""
    hiding = [cause for cause in _SUPPLY if cause in bits]
    return hiding[0] if hiding else _MEANINGS.get(frozenset(bits), ResetCause.UNDETERMINED)
