"""Pins of SunSlit's FPGA, in the order of the gateware's ports: one table for all who need them."""

from cubestack.sensor import Pin, sram_pins

OSC = Pin("OSC", "input", "oscillator of FPGA, array and converter")
ADC = Pin("ADC", "input", "converter: the pixel that the array puts out", 8)
VALID = Pin("VALID", "input", "converter: low while the array's output is off")
ENABLE = Pin("ENABLE", "input", "leave standby")
RNW = Pin("RNW", "input", "read the memory, not the array")
EXPOSE = Pin("EXPOSE", "input", "its edges begin and end the integration")
DCLK = Pin("DCLK", "input", "data clock from the microcontroller")
CLK = Pin("CLK", "output", "the array's clock")
SI = Pin("SI", "output", "the array's start pulse: put the pixels out and integrate anew")
ACK = Pin("ACK", "output", "both readouts are stored")
DATA = Pin("DATA", "output", "stored bytes to the microcontroller", 8)

PINS = (OSC, ADC, VALID, ENABLE, RNW, EXPOSE, DCLK, CLK, SI, ACK, DATA, *sram_pins(8))
