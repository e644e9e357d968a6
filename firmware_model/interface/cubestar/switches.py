"""Where CubeStar's firmware can do what its thesis prints, or better."""

from dataclasses import dataclass

from cubestack.firmware_model.interface.codec.switches import Switches, switch


@dataclass(frozen=True)
class CubeStarSwitches(Switches):
    """Switches of the algorithms; all sections are those of the CubeStar thesis."""

    voting: str = switch(
        "how identities are voted for",
        "algorithm-2",
        "rounds",
        source="section 4.3.3, Algorithm 2",
        reason="one round leaves wrong stars among false ones; repeated rounds over the same "
        "entries, and refusing ties, mirror images and chance, leave none",
    )
    weights: str = switch(
        "what a pixel weighs in its star's centroid",
        "intensity",
        "above-threshold",
        source="equations 4.1.1 and 4.1.2",
        reason="the plain intensity pulls the centroid towards the middle of the area",
    )
    tracking: str = switch(
        "what a tracked star must satisfy",
        "nearest",
        "verified",
        source="section 4.5",
        reason="a faint star near another's place is taken for it; the angles between all tracked "
        "stars tell",
    )
    pair_limit: str = switch(
        "widest pair of stars in the list, in degrees",
        "42.1",
        "57.3",
        "60",
        source="section 4.3.2: 11 484 pairs need 42.1, the text's field of view is 60",
        reason="57.3 is the diagonal of the calibrated camera, so that every pair in a picture is "
        "listed",
    )


#: Those of the default profile.
DEFAULT_SWITCHES = CubeStarSwitches()
