"""Native code: a C++ compiler, and libraries that are built once and kept."""
