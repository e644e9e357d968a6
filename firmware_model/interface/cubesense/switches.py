"""Choices of CubeSense's firmware between its thesis' algorithms and better ones."""

from dataclasses import dataclass

from cubestack.firmware_model.interface.codec.switches import Switches, switch


@dataclass(frozen=True)
class CubeSenseSwitches(Switches):
    """Switches of the vision; all sections are those of the CubeSense thesis."""

    distortion: str = switch(
        "table that undoes the lens, and the projection that the Earth's edges are fitted in",
        "byte-table",
        "stereographic",
        "equidistant",
        source="sections 6.2 and 6.3, appendix C.2",
        reason="bytes hold whole pixels of 0.34 deg, 16-bit entries 1/100 px; the limb is a circle "
        "in stereographic pixels only (the Sun's are equidistant in any case)",
    )
    edges: str = switch(
        "where an edge of the Earth lies",
        "whole-pixel",
        "sub-pixel",
        "listing",
        source="section 6.5.2, appendix C.4; listing has the two slips of appendix C.3",
        reason="a straight line through the two pixels of an edge tells where it meets the "
        "threshold; the listing places edges of the last 32 rows 224 rows too high, and has the "
        "rim of the field around (367, 237)",
    )
    limb: str = switch(
        "which edges make the circle of the Earth",
        "unchecked",
        "robust",
        source="section 6.5.3.1, appendix C.5",
        reason="the terminator, clouds, Moon, reflections and glint have edges too and pull the "
        "circle away; robust keeps edges that are dark outside, looks for the circle that most "
        "of them lie on, with the bright side in, says how sure it is, and refuses what is none",
    )
    sun: str = switch(
        "which pixels of the Sun's window count, and whether they are a Sun",
        "all-pixels",
        "confirmed",
        source="sections 4.4.2 and 6.6.3, appendix C.6",
        reason="a Sun that overflows the window is cut, and its mean moves; what has not the Sun's "
        "size, shape and saturated middle, is in pieces or outside of the field is none; what ends "
        "too sharply is told with a sigma of 48 deg",
    )
    lens: str = switch(
        "what each camera's lens is beside the polynomial that the firmware undoes",
        "residuals",
        "nominal",
        source="sections 5.1.1, 7.1 and 7.2: errors left after the calibration, one polynomial for "
        "two lenses; drawn for each unit, by its seed",
        reason="nominal shows what firmware and pixels alone do",
        hardware=True,
    )
    gateware: str = switch(
        "what the FPGA presents without a Sun and at the picture's border, and over the link",
        "as-flown",
        "corrected",
        "one-search",
        source="appendices D.3 and D.4; one-search: table 6.4 to the word, section 9.2.3",
        reason="as flown the coordinates stay those of an earlier Sun or of a lone bright pixel, "
        "and the window wraps into memory that no picture fills; one search less in each FPGA "
        "sends whole pictures over the link, for seconds",
        hardware=True,
    )


DEFAULT_SWITCHES = CubeSenseSwitches()
