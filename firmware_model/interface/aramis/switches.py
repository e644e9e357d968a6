"""Choices of AraMiS' firmware between the algorithms that its thesis prints and better ones."""

from dataclasses import dataclass
from typing import Literal

from cubestack.firmware_model.interface.codec.switches import Switches, switch


@dataclass(frozen=True)
class AramisSwitches(Switches):
    """Switches of the algorithms; sections and appendices are those of the AraMiS thesis."""

    belief: str = switch(
        "which attitude is accepted",
        "unique",
        "confirmed",
        source="sections 5.7 and 8.2, appendix E",
        reason="a unique triangle can be the wrong one; further stars decide, unless "
        "SetIdentification turns Verify off",
    )
    pivots: str = switch(
        "when a pivot triangle is measured",
        "always",
        "when-needed",
        source="appendix E; section 5.7 has pivots only for several candidates",
        reason="a pivot with a false star discards the right triangle",
    )
    aided: str = switch(
        "what a unique triangle near a rough direction must satisfy",
        "faces",
        "filtered",
        source="section 5.9, appendix E",
        reason="the faces reach up to 35 degrees from the direction; boresight and sides exclude "
        "most wrong triangles",
    )
    identities: Literal["section-5.8", "either", "appendix-e"] = switch(
        "how the stars of a triangle are distinguished",
        "section-5.8",
        "either",
        "appendix-e",
        source="section 5.8; the listing of appendix E differs and contradicts it",
        reason="the criterion that loses can be the right one: if a triangle is checked, both are "
        "tried",
    )
    noise: str = switch(
        "noise of a direction, from which the bounds are computed",
        "appendix-e",
        "setting",
        source="appendix E: 0.26 px of 582 across the field, whatever the sensor",
        reason="SetIdentification has the noise of this sensor's centroids",
    )
    weights: str = switch(
        "weight of a pixel in its star's centroid",
        "grey-level",
        "above-mean",
        source="equation 3.10",
        reason="the plain grey level pulls the centroid towards the middle of the region; "
        "SetDetection turns Subtract off",
    )
    detection: str = switch(
        "threshold of a bright pixel",
        "whole-picture",
        "local",
        source="section 3.5",
        reason="with stray light, the Moon, the Earth's limb or hot pixels no threshold fits the "
        "whole image; each place has its own, stars are recognised by their shape, and twice "
        "MaxStars are kept",
    )
    library: str = switch(
        "costs of the processor's floating-point library",
        "vendor",
        "vendor",
        "compiled",
        source="chapters 7 and 8: programs in MATLAB, no compiler for the part",
        reason="vendor is Analog Devices' library as published, with functions composed of its "
        "operations; compiled is gcc's in C, the slowest; every time is between the two",
        hardware=True,
    )
    scores: Literal["deviation", "variance"] = switch(
        "what the score of a criterion is, over the mean of its three values",
        "deviation",
        "deviation",
        "variance",
        source="tables 5.2 and 5.3",
        reason="the score is called the coefficient of variation, which has the standard "
        "deviation; section 5.8 calls its numerator the variance",
    )
    ram: Literal["checksum", "redundant", "coded"] = switch(
        "how the catalogue in RAM is protected",
        "checksum",
        "checksum",
        "redundant",
        "coded",
        source="section 2.3.3: RAM should be able to store a redundant or Hamming-coded catalogue; "
        "no printed program does",
        reason="checksum finds damage and loads the catalogue again; the others mend it in RAM, "
        "for memory and time",
        hardware=True,
    )


DEFAULT_SWITCHES = AramisSwitches()
