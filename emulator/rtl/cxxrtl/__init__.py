"""The compiled engine: CXXRTL, a C++ driver around it, and their build."""
