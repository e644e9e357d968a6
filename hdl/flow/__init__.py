"""From a design to the inputs of other tools: tops by name, Verilog, C++, area."""
