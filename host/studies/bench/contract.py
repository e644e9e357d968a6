"""What a device offers to `cubestack bench`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Benchmark:
    """Measures the cost of emulating a device."""

    figures: Mapping[str, str]  #: meaning of each figure, by its name in the JSON output
    #: measures a device: figures by name, without those that can't be measured here
    run: Callable[[Any], Mapping[str, float]]
