"""A program's calls, taken by seccomp user notification."""
