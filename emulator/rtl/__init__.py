"""FPGAs in virtual time: compiled to C++, or in Amaranth's simulator."""
