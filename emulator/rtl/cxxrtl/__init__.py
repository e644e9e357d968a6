"""The compiled engine: CXXRTL's C++ of a design, a C++ driver, and the build of both."""
