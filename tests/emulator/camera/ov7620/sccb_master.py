"""The microcontroller's end of the camera control bus, pin by pin."""

from collections.abc import Callable

US = 10**6

Pin = Callable[[str, int, int], None]


def send(
    pin: Pin, sda: Callable[[], int], data: bytes, now_ps: int = 0, step_ps: int = 3 * US
) -> list[int]:
    """Start, bytes with a ninth bit each, stop; returns SDA as read in the ninth bits."""
    answers: list[int] = []

    def step(name: str, level: int) -> None:
        nonlocal now_ps
        now_ps += step_ps
        pin(name, level, now_ps)

    for name, level in (("SDA", 1), ("SCL", 1), ("SDA", 0), ("SCL", 0)):
        step(name, level)
    for byte in data:
        for n in range(8):
            step("SDA", byte >> (7 - n) & 1)
            step("SCL", 1)
            step("SCL", 0)
        step("SDA", 1)
        step("SCL", 1)
        answers.append(sda())
        step("SCL", 0)
    for name, level in (("SDA", 0), ("SCL", 1), ("SDA", 1)):
        step(name, level)
    return answers
