"""A fake compiler with configurable results."""

from pathlib import Path


def make_compiler(folder: Path, name: str, on_compile: str, version: str = "1.0") -> Path:
    """A compiler that knows its version and, when it is to compile, runs ``on_compile``."""
    program = folder / name
    program.write_text(
        f'#!/bin/sh\ncase "$*" in *--version) echo {version}; exit 0;; esac\n{on_compile}\n'
    )
    program.chmod(0o755)
    return program
