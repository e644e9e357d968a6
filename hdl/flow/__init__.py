"""From a design to what tools take: tops by name, Verilog, C++, area."""
