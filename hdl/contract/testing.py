"""Registration of a contract's cocotb tests, and what they report while they run."""

import os
from collections.abc import Awaitable, Callable
from functools import wraps
from pathlib import Path
from typing import Any

import cocotb

#: Names the file that each test adds its name to when it begins.
PROGRESS = "CONTRACT_PROGRESS"


def contract_test(timeout_ms: int = 60) -> Callable[[Callable[[Any], Awaitable[None]]], Any]:
    """Decorator of a test of a contract; fails if it takes longer than ``timeout_ms`` simulated."""

    def register(test: Callable[[Any], Awaitable[None]]) -> Any:
        @wraps(test)
        async def noted(dut: Any) -> None:
            if path := os.environ.get(PROGRESS):
                with Path(path).open("a", encoding="utf-8") as file:
                    file.write(f"{test.__name__}\n")
            await test(dut)

        return cocotb.test(timeout_time=timeout_ms, timeout_unit="ms")(noted)

    return register
