"""A program's calls, taken by a library that is loaded into it."""
