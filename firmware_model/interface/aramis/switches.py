"""Choices of AraMiS' firmware between the algorithms that its thesis prints and better ones."""

from dataclasses import dataclass
from typing import Literal

from cubestack.firmware_model.interface.codec.switches import Switches, switch


@dataclass(frozen=True)
class AramisSwitches(Switches):
    """Switches of the algorithms; sections and appendices are those of the AraMiS thesis."""

    belief: str = switch(
        "which attitude is believed",
        "unique",
        "confirmed",
        source="sections 5.7 and 8.2, appendix E",
        reason="a unique triangle can be another one; further stars tell, unless "
        "SetIdentification turns Verify off",
    )
    pivots: str = switch(
        "when a pivot triangle is measured",
        "always",
        "when-needed",
        source="appendix E; section 5.7 has pivots only for several candidates",
        reason="a pivot with a false star loses the right triangle",
    )
    aided: str = switch(
        "what a unique triangle near a rough direction must satisfy",
        "faces",
        "filtered",
        source="section 5.9, appendix E",
        reason="the faces reach up to 35 degrees from the direction; boresight and sides rule out "
        "most of what is wrong",
    )
    identities: Literal["section-5.8", "either", "appendix-e"] = switch(
        "how the stars of a triangle are told apart",
        "section-5.8",
        "either",
        "appendix-e",
        source="section 5.8; the listing of appendix E differs and contradicts it",
        reason="the criterion that loses can be the right one: where a triangle is checked, both "
        "are tried",
    )
    noise: str = switch(
        "noise of a direction that the bounds are made of",
        "appendix-e",
        "setting",
        source="appendix E: 0.26 px of 582 across the field, whatever the sensor",
        reason="SetIdentification has the noise of this sensor's centroids",
    )
    weights: str = switch(
        "what a pixel weighs in its star's centroid",
        "grey-level",
        "above-mean",
        source="equation 3.10",
        reason="the plain grey level pulls the centroid towards the middle of the region; "
        "SetDetection turns Subtract off",
    )
    detection: str = switch(
        "what a bright pixel is above",
        "whole-picture",
        "local",
        source="section 3.5",
        reason="stray light, the Moon, the Earth's limb or hot pixels leave no threshold for the "
        "whole picture; each place has its own, stars are told by their shape, and twice MaxStars "
        "are kept",
    )


DEFAULT_SWITCHES = AramisSwitches()
