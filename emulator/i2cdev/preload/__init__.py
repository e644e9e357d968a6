"""Handles a program's calls by a library that is loaded into it."""
