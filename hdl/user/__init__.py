"""A user's own design in place of a shipped top: read, checked against the pins, converted."""

from cubestack.hdl.user.gateware import Gateware, load_gateware
from cubestack.hdl.user.source import GatewareError

__all__ = ["Gateware", "GatewareError", "load_gateware"]
