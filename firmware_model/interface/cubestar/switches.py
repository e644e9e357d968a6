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
        reason="with false stars the votes elect wrong identities; an attitude proposed by "
        "triangles is accepted if chance confirms one in fewer than 1 of 10 000 images",
    )
    weights: str = switch(
        "weight of a pixel in its star's centroid",
        "intensity",
        "above-threshold",
        source="equations 4.1.1 and 4.1.2",
        reason="the plain intensity pulls the centroid towards the middle of the area",
    )
    tracking: str = switch(
        "condition on a tracked star",
        "nearest",
        "verified",
        source="section 4.5",
        reason="a faint star near another's place is mistaken for it; the angles between all "
        "tracked stars, and the probability of their match by chance, reveal that",
    )
    pair_limit: str = switch(
        "widest pair of stars in the list, in degrees",
        "42.1",
        "57.3",
        "60",
        source="sections 4.3.2 and 5.3.2 have 11 486 and 11 484 pairs, near the 11 483 of 42.1; "
        "the field of view is 60 in section 4.3.4",
        reason="57.3 is the diagonal of the calibrated camera, so that every pair in an image is "
        "listed",
    )
    reduction: str = switch(
        "radius of the reduced catalogue for tracking, in degrees",
        "30.3",
        "35",
        source="section 5.3.4: just wider than the field if the attitude is known well; 4.3.4 uses "
        "30 for the field, and tracking moves by 0.3 at most",
        reason="the calibrated camera's farthest corner is 31.3 from the boresight",
    )
    flash_store: str = switch(
        "cost of storing attitude and mode flag",
        "page",
        "nothing",
        source="section 5.3.5: quaternion and DCM are written to flash at every turn",
        reason="a page takes 20 ms to erase and endures 20 000 erasures, 5.6 hours of the loop",
    )
    transitions: str = switch(
        "how the mode flag changes, and which attitudes it accepts",
        "automatic",
        "confirmed",
        source="sections 5.3.4 and 6.1: the flag follows the attitude determination, and is soon "
        "tracking; after a failure (not printed): lost in space",
        reason="a search covers the possible rotation of the body, and an attitude that "
        "contradicts the last one must be certain or found twice",
    )
    estimate: str = switch(
        "weight of a star in the attitude",
        "votes",
        "inverse-variance",
        source="section 5.3.4: the votes of the verification round",
        reason="bright stars are measured better than faint ones; the attitude's covariance "
        "follows from the weights",
    )
    detection: str = switch(
        "threshold of a star's pixels, and which pixels are read",
        "sampled",
        "background",
        source="section 5.3.3: every third pixel of every third row against a fixed threshold; the "
        "search ends at 20 stars, counted from the top",
        reason="stray light, noise and hot pixels pass a fixed threshold, the brightest stars may "
        "be further down, and faint spots fall between the samples; beside the Earth's limb a "
        "pixel is compared with its surroundings",
    )

    equation: str = switch(
        "how equation 4.4.9 is solved, with weights of votes",
        "rotated",
        "rotated",
        "printed",
        source="section 4.4: Gaussian elimination of one system",
        reason="near a rotation by 180 deg from the inertial axes the printed system is nearly "
        "singular and rounding grows; rotated solves the best of four turned systems",
    )
    following: str = switch(
        "search of the image after one that was solved",
        "tracking",
        "tracking",
        "assisted",
        source="section 4.5; assisted is sections 4.3.4 and 4.3.5: the previous attitude in place "
        "of a hint, as an alternative to tracking",
        reason="assisted needs three stars and the whole vote, but no slow motion",
    )
    remap: str = switch(
        "8 bits of a pixel, of the camera's 12, with its histogram remap and AutoView on",
        "upper-bits",
        "upper-bits",
        "stretched",
        "equalized",
        source="appendix D turns both on for stars, without the algorithm; its second footnote: "
        "most such features have no effect at this clock",
        reason="stretched maps the range of the values of a frame to 0 to 255, equalized gives "
        "each grey value the same number of pixels; both are assumed",
        hardware=True,
    )
    gyro: str = switch(
        "body rate from the stars of two successive images, telemetry StellarGyro",
        "off",
        "off",
        "on",
        source="section 7.2 proposes it for a later version",
        reason="on works without identification, with few stars and with stars of no catalogue",
    )
    bodies: str = switch(
        "planets and Moon of telecommand SetBody as known objects, telemetry Bodies",
        "off",
        "off",
        "on",
        source="section 7.2 proposes to track both in a later version",
        reason="on matches planets as stars and refuses an attitude with a dark sky where the Moon "
        "must be",
    )


DEFAULT_SWITCHES = CubeStarSwitches()
