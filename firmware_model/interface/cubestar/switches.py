"""Choices of CubeStar's firmware between its thesis' algorithms and better ones."""

from dataclasses import dataclass

from cubestack.firmware_model.interface.codec.switches import Switches, switch


@dataclass(frozen=True)
class CubeStarSwitches(Switches):
    """Switches of the algorithms; all sections are those of the CubeStar thesis."""

    voting: str = switch(
        "how stars are identified",
        "algorithm-2",
        "confirmed",
        source="section 4.3.3, Algorithm 2",
        reason="votes name wrong stars among false ones; an attitude that triangles propose is "
        "believed when chance would confirm it less than once in 10 000 pictures",
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
        reason="a faint star near another's place is taken for it: the angles between all tracked "
        "stars tell, and how often chance would confirm their attitude",
    )
    pair_limit: str = switch(
        "widest pair of stars in the list, in degrees",
        "42.1",
        "57.3",
        "60",
        source="section 4.3.2: 42.1 is chosen for its 11 484 pairs, the text's field of view is 60",
        reason="57.3 is the diagonal of the calibrated camera, so that every pair in a picture is "
        "listed",
    )
    reduction: str = switch(
        "radius of the reduced catalogue that a star is tracked in, in degrees",
        "30.3",
        "35",
        source="section 5.3.4: just wider than the field when the attitude is known well; 4.3.4 "
        "takes 30 for the field, and tracking moves by 0.3 at most",
        reason="the calibrated camera's farthest corner is 31.3 from the boresight",
    )
    flash_store: str = switch(
        "what it costs to store attitude and mode flag",
        "page",
        "nothing",
        source="section 5.3.5: quaternion and DCM go to flash at every turn",
        reason="a page takes 20 ms to erase and stands 20 000 times, 5.6 hours of the loop",
    )
    transitions: str = switch(
        "how the mode flag changes, and which attitude is believed",
        "automatic",
        "confirmed",
        source="sections 5.3.4 and 6.1: the flag follows the attitude determination, and is soon "
        "tracking; after a failure (not printed): lost in space",
        reason="a search is as wide as the body can have turned, and an attitude that contradicts "
        "the last one has to be sure or found twice",
    )
    estimate: str = switch(
        "what a star weighs in the attitude",
        "votes",
        "inverse-variance",
        source="section 5.3.4: the votes of the verification round",
        reason="bright stars are measured better than faint ones; the weights give the attitude's "
        "covariance too",
    )
    detection: str = switch(
        "what a star's pixels are brighter than, and which pixels are read",
        "sampled",
        "background",
        source="section 5.3.3: every third pixel of every third row against a fixed threshold; the "
        "search ends at 20 stars, counted from the top",
        reason="stray light, noise and hot pixels pass a fixed threshold, the brightest stars may "
        "stand further down, and faint spots fall between the samples; beside the Earth's limb a "
        "pixel is compared with what surrounds it",
    )


DEFAULT_SWITCHES = CubeStarSwitches()
