"""Choices of CubeSense's firmware between its thesis' algorithms and better ones."""

from dataclasses import dataclass

from cubestack.firmware_model.interface.codec.switches import Switches, switch


@dataclass(frozen=True)
class CubeSenseSwitches(Switches):
    """Switches of the vision; all sections are those of the CubeSense thesis."""

    distortion: str = switch(
        "table that corrects the lens, and the projection in which the Earth's edges are fitted",
        "byte-table",
        "stereographic",
        "equidistant",
        source="sections 6.2 and 6.3, appendix C.2",
        reason="bytes hold whole pixels of 0.34 deg, 16-bit entries 1/100 px; the limb is a circle "
        "in stereographic pixels only (the Sun's are equidistant in any case)",
    )
    edges: str = switch(
        "position of an edge of the Earth",
        "whole-pixel",
        "sub-pixel",
        "listing",
        source="section 6.5.2, appendix C.4; listing has the two slips of appendix C.3",
        reason="a straight line through the two pixels of an edge shows where it meets the "
        "threshold; the listing places edges of the last 32 rows 224 rows too high, and the rim "
        "of the field around (367, 237)",
    )
    limb: str = switch(
        "which edges form the circle of the Earth",
        "unchecked",
        "robust",
        source="section 6.5.3.1, appendix C.5",
        reason="the terminator, clouds, Moon, reflections and glint have edges too and pull the "
        "circle away; robust keeps edges that are dark outside, finds the circle with most of "
        "them on it and the bright side inside, reports its uncertainty, and rejects other shapes",
    )
    sun: str = switch(
        "which pixels of the Sun's window count, and whether they are a Sun",
        "all-pixels",
        "confirmed",
        source="sections 4.4.2 and 6.6.3, appendix C.6",
        reason="a Sun larger than the window is cut, and its mean moves; light without the Sun's "
        "size, shape and saturated middle, in pieces or outside of the field is rejected; light "
        "with a sharp edge is reported with a sigma of 48 deg",
    )
    lens: str = switch(
        "deviation of each camera's lens from the polynomial that the firmware corrects",
        "residuals",
        "nominal",
        source="sections 5.1.1, 7.1 and 7.2: errors left after the calibration, one polynomial for "
        "two lenses; drawn for each unit, by its seed",
        reason="nominal shows the effects of firmware and pixels alone",
        hardware=True,
    )
    gateware: str = switch(
        "output of the FPGA without a Sun, at the image border, and over the link",
        "one-search",
        "corrected",
        "both-searches",
        source="appendices D.3 and D.4; table 6.4 and section 9.2.3: each FPGA has the search of "
        "its own sensor",
        reason="as printed the coordinates stay those of an earlier Sun or of a single bright "
        "pixel, and the window wraps into memory outside of the image; with one search whole "
        "images are sent over the link, for seconds; both printed searches do not fit the part, "
        "by our count 774 of 768 tiles, and those of corrected do",
        hardware=True,
    )
    library: str = switch(
        "costs of the processor's floating-point library",
        "notes",
        "notes",
        "compiled",
        source="section 6.1.1: Microchip's C18, whose library has no published cycles",
        reason="notes are Microchip's application note AN575 with the part's multiplier, the "
        "fastest; compiled is sdcc's library in C, the slowest; every time is between the two",
        hardware=True,
    )
    clock: str = switch(
        "meaning of the 5 MHz in the formula of the processor's timer",
        "instructions",
        "instructions",
        "oscillator",
        source="section 7.4: F_OSC = 5 MHz",
        reason="oscillator is the formula to the letter, four clocks per instruction: the program "
        "takes four times as long, and the thesis' timer would disagree with its oscilloscope",
        hardware=True,
    )
    threshold: str = switch(
        "threshold of bright pixels",
        "fixed",
        "fixed",
        "dynamic",
        source="section 4.1.1: fixed, as the text prefers; dynamic is the mean of all pixels, "
        "equation 4.1.1, which the text rejects",
        reason="dynamic replaces the threshold of the telecommand in both cameras' images; the "
        "processor reads the whole image for it, the FPGA's own threshold for the Sun stays",
        hardware=True,
    )


DEFAULT_SWITCHES = CubeSenseSwitches()
