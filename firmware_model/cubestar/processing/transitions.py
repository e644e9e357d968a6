"""Which search identifies the next picture, and which attitude is believed: two sets of rules.

`Automatic` is what the CubeStar thesis says (sections 5.3.4 and 6.1): the mode flag counts, an
attitude leads to tracking, and, assumed, a failure leads to lost in space. Without an attitude and
a hint (telecommand setTrackingMode) the node is lost in space, whatever the flag says.

`Confirmed` knows how well an attitude was confirmed, how old it is, and how far the body can have
turned since then:

| from | what happens | to |
|---|---|---|
| any | setIDMode lost in space: each picture is judged by itself, what was known is void | lost |
| any | setTrackingMode: a hint of the host is worth more than what was known | assisted |
| lost, assisted, tracking | a believed attitude; it is the base from now on | tracking |
| tracking | failure | assisted, within the cone that the body can have turned through |
| assisted by the base | failure | assisted, until the cone is wider than `WIDEST_CONE_DEG` |
| assisted by a hint | failure; the hint is used up | lost |
| tracking, assisted | the cone is too wide: the last picture is too long ago | lost |
| any | an attitude that contradicts the base: it is kept as a candidate only | lost |

An attitude contradicts the base if the body can not have turned so far since then. It is believed
nevertheless if its own false-alarm probability is below `SURE`, or if the next attitude agrees
with it: so neither a wrong base nor a wrong attitude lasts. Only believed attitudes are reported as
valid and stored. A base that is older than half a turn takes contradicts nothing; after a power
cycle there is none. With switch ``following`` set to assisted, a believed attitude leads to
assisted in both sets.
"""

from dataclasses import replace
from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.state import Attitude, State
from cubestack.firmware_model.interface.cubestar.codes import IdMode, MatchMode
from cubestack.firmware_model.mcu.costs import Meter

#: Body rate that is reckoned with: three times what can be tracked (section 4.5: 0.3 deg in each
#: iteration of a second); stars smear over more pixels than they can fill at still larger ones.
LARGEST_RATE_DEG_S = 1.0

REACH_DEG = 0.3  #: two attitudes closer than this agree, however short the time between them

#: Largest error of the boresight that assisted matching searches with (section 4.3.4).
WIDEST_CONE_DEG = 5.0

#: False-alarm probability below which an attitude needs no second one, whatever was known.
SURE = 1e-8

_HALF_TURN_DEG = 180.0
_U32 = 1 << 32


class Automatic:
    """All that happens to the mode flag; as published, every attitude is believed."""

    def __init__(self, state: State) -> None:
        self._state = state

    def choose(self) -> MatchMode:
        state = self._state
        if state.mode is MatchMode.LOST_IN_SPACE:
            return MatchMode.LOST_IN_SPACE
        if state.attitude is None and not state.retained.hint_present:
            state.raise_flag("IDModeError")
            return MatchMode.LOST_IN_SPACE
        return state.mode

    def cone_deg(self) -> float:
        """How far the boresight may be from the expected one."""
        return WIDEST_CONE_DEG

    def believes(self, attitude: Attitude, false_alarm: float) -> bool:
        """Whether a new attitude may be reported and stored."""
        return True

    def solved(self) -> None:
        """The next picture is searched near this attitude."""
        tracked = self._state.switches.now.following == "tracking"
        self._state.mode = MatchMode.TRACKING if tracked else MatchMode.ASSISTED

    def failed(self, mode: MatchMode) -> None:
        """A picture was not identified in ``mode``."""
        self._state.mode = MatchMode.LOST_IN_SPACE

    def commanded(self, mode: IdMode) -> None:
        if mode == IdMode.LOST_IN_SPACE:
            self._state.mode = MatchMode.LOST_IN_SPACE

    def hinted(self) -> None:
        self._state.mode = MatchMode.ASSISTED


class Confirmed(Automatic):
    """Recovers from wrong attitudes: see the table above."""

    def __init__(self, state: State, meter: Meter) -> None:
        super().__init__(state)
        self._meter = meter

    @property
    def _alone(self) -> bool:
        return bool(self._state.settings.get("setIDMode", "IdMode") == IdMode.LOST_IN_SPACE)

    @property
    def _base(self) -> Attitude | None:
        """The last believed attitude, unless it tells nothing about the picture any more."""
        base = self._state.attitude if self._state.retained.confirmed else None
        return None if base is None or self._turned_deg(base) > _HALF_TURN_DEG else base

    def _turned_deg(self, since: Attitude, image_ms: int | None = None) -> float:
        """How far the body can have turned up to a picture, the latest one if None."""
        at_ms = self._state.retained.image_ms if image_ms is None else image_ms
        return REACH_DEG + LARGEST_RATE_DEG_S * ((at_ms - since.image_ms) % _U32) / 1000

    def choose(self) -> MatchMode:
        state = self._state
        if self._alone:
            return MatchMode.LOST_IN_SPACE
        if state.retained.hint_present:
            return MatchMode.ASSISTED
        if self._base is None:
            state.raise_flag("IDModeError")
            return MatchMode.LOST_IN_SPACE
        return state.mode if self.cone_deg() <= WIDEST_CONE_DEG else MatchMode.LOST_IN_SPACE

    def cone_deg(self) -> float:
        """The hint's published error, else what the body can have turned since the base."""
        base = self._base
        hinted = self._state.retained.hint_present or base is None
        return WIDEST_CONE_DEG if hinted or base is None else self._turned_deg(base)

    def believes(self, attitude: Attitude, false_alarm: float) -> bool:
        """Whether nothing contradicts it, or it is sure, or the one before it was the same."""
        state, base = self._state, self._base
        candidate, state.candidate = state.candidate, None
        if self._alone or state.retained.hint_present or base is None or false_alarm < SURE:
            return True
        if self._agree(base, attitude) or (candidate and self._agree(candidate, attitude)):
            return True
        state.candidate = replace(attitude, rotation=None)
        state.mode = MatchMode.LOST_IN_SPACE
        return False

    def _agree(self, before: Attitude, after: Attitude) -> bool:
        largest = min(self._turned_deg(before, after.image_ms), _HALF_TURN_DEG)
        self._meter.charge(f32_mul=4, f32_add=3, f32_sin=1, f32_compare=2)
        return cosine_of_half(before.quaternion, after.quaternion) >= cos(radians(largest / 2))

    def solved(self) -> None:
        self._state.retained.confirmed = 1
        super().solved()

    def failed(self, mode: MatchMode) -> None:
        """One step back, as far as what is known allows."""
        state = self._state
        hinted, state.retained.hint_present = state.retained.hint_present, 0
        lost = mode is MatchMode.LOST_IN_SPACE or (hinted and mode is MatchMode.ASSISTED)
        state.mode = MatchMode.LOST_IN_SPACE if lost else MatchMode.ASSISTED

    def commanded(self, mode: IdMode) -> None:
        if mode == IdMode.LOST_IN_SPACE:
            self._state.retained.confirmed = 0
            self._state.candidate = None

    def hinted(self) -> None:
        self._state.retained.confirmed = 0
        self._state.candidate = None
        super().hinted()


def transitions_of(state: State, meter: Meter) -> Automatic:
    """The rules that switch ``transitions`` selects."""
    automatic = state.switches.now.transitions == "automatic"
    return Automatic(state) if automatic else Confirmed(state, meter)


def cosine_of_half(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Cosine of half the angle of the rotation between two attitudes (4,)."""
    return abs(float(np.dot(one, other)))
