"""Faults that can be planted in a placed netlist, to see that a comparison finds them."""

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace
from random import Random

from cubestack.hdl.devboard.netlist.cells import Netlist, NetlistError


def _lut_bit(netlist: Netlist, random: Random) -> str:
    """Invert one bit of a table, for levels that its inputs can have."""
    places = [n for n, lut in enumerate(netlist.luts) if _of_design(netlist, lut.output)]
    place = _choose(places, random)
    lut = netlist.luts[place]
    open_inputs = sum(1 << n for n, net in enumerate(lut.inputs) if net is None)
    bit = random.choice([n for n in range(1 << len(lut.inputs)) if not n & open_inputs])
    netlist.luts[place] = replace(lut, table=lut.table ^ 1 << bit)
    return f"bit {bit} of the table of {netlist.name(abs(lut.output))} is inverted"


def _stuck_net(netlist: Netlist, random: Random) -> str:
    """Hold a net at 0 or 1."""
    places = [n for n, flop in enumerate(netlist.flip_flops) if _of_design(netlist, flop.output)]
    flop = netlist.flip_flops.pop(_choose(places, random))
    level = random.randrange(2)
    netlist.constants[flop.output] = level
    return f"{netlist.name(flop.output)} is stuck at {level}"


def _swapped_data(netlist: Netlist, random: Random) -> str:
    """Exchange the data inputs of two flip-flops."""
    found = netlist.flip_flops
    places = [n for n, flop in enumerate(found) if _of_design(netlist, flop.output)]
    first = _choose(places, random)
    second = _choose([n for n in places if found[n].data != found[first].data], random)
    one, other = found[first], found[second]
    found[first], found[second] = replace(one, data=other.data), replace(other, data=one.data)
    names = netlist.name(one.output), netlist.name(other.output)
    return f"the data inputs of {names[0]} and {names[1]} are exchanged"


#: By name. Each changes the netlist inside of the design and says in words what it did.
MUTANTS: Mapping[str, Callable[[Netlist, Random], str]] = {
    "lut-bit": _lut_bit,
    "stuck-net": _stuck_net,
    "swapped-data": _swapped_data,
}


def mutate(netlist: Netlist, name: str, seed: int) -> tuple[Netlist, str]:
    """A copy with one fault, and what it is; ValueError for an unknown name."""
    if name not in MUTANTS:
        raise ValueError(f"{name!r} is no mutant; they are {', '.join(MUTANTS)}")
    changed = copy(netlist)
    changed.luts, changed.flip_flops = [*netlist.luts], [*netlist.flip_flops]
    changed.constants = {**netlist.constants}
    return changed, MUTANTS[name](changed, Random(seed))


def _of_design(netlist: Netlist, net: int) -> bool:
    return "bridged.design." in netlist.name(abs(net))


def _choose(places: list[int], random: Random) -> int:
    if not places:
        raise NetlistError("the netlist has no such cell inside of the design")
    return random.choice(places)
