"""Values of options: checked, with errors that say what would be right."""

import argparse
import math
from collections.abc import Callable
from typing import NoReturn

__all__ = ["Parser", "angle", "corner", "number", "positive", "whole"]


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """End with exit code 2."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def whole(least: int, most: int | None = None) -> Callable[[str], int]:
    """Type of a whole number in ``least``..``most``."""
    wanted = f"of at least {least}" if most is None else f"in {least}..{most}"

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least or (most is not None and value > most):
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number {wanted}")
        return value

    return read


def angle(text: str) -> float:
    """Type of an angle in degrees that is not negative."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value <= 180:
        raise argparse.ArgumentTypeError(f"{text!r} is not an angle in 0..180 degrees")
    return value


def number(text: str) -> float:
    """Type of a number, of either sign."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number")
    return value


def positive(text: str) -> float:
    """Type of a number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return value


def corner(text: str) -> tuple[int, int]:
    """Type of a pixel's column and row."""
    try:
        left, top = (int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y, as in 0,256") from None
    return left, top
