"""Handles a program's calls by seccomp user notification."""
