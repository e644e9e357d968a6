"""The cover against the best one of all, on networks small enough to try every one."""

import random
from itertools import combinations, product

import pytest

from cubestack.hdl.flow.lut_cover import FALSE, TRUE, GateNetwork

SOURCES, GATES = 4, 7


def network(rng: random.Random) -> tuple[GateNetwork, list[int]]:
    net = GateNetwork()
    signals = [net.source() for _ in range(SOURCES)]
    for _ in range(GATES):
        a, b, c = (rng.choice(signals) ^ rng.getrandbits(1) for _ in range(3))
        signals.append(rng.choice([net.and_(a, b), net.xor(a, b), net.mux(a, b, c)]))
    wanted = [s for s in rng.sample(signals[SOURCES:], 2) if s > 2 * SOURCES + 1]
    return net, [signal & ~1 for signal in wanted]


def cuts(net: GateNetwork, node: int) -> set[frozenset[int]]:
    """All sets of nodes that a gate is a function of."""
    choices = [{frozenset([child])} | cuts(net, child) for child in net._fan_in[node]]
    return {frozenset().union(*parts) for parts in product(*choices)} if choices else set()


def best(net: GateNetwork, wanted: list[int]) -> int:
    """Fewest gates that can all be tables of three inputs and make what is wanted."""
    roots = {signal >> 1 for signal in wanted}
    gates = range(SOURCES + 1, max(roots, default=0) + 1)
    options = {node: [cut for cut in cuts(net, node) if len(cut) <= 3] for node in gates}
    for size in range(len(gates) + 1):
        for chosen in combinations(gates, size):
            allowed = {*chosen, *range(1, SOURCES + 1)}
            if roots <= set(chosen) and all(
                any(cut <= allowed for cut in options[node]) for node in chosen
            ):
                return size
    raise AssertionError("each gate alone is a table")


def test_lut_cover_is_within_2_percent_of_the_optimum():
    rng = random.Random(1)
    cases = (network(rng) for _ in range(300))
    excess = [net.tables(wanted) - best(net, wanted) for net, wanted in cases]
    assert min(excess) == 0
    assert sum(excess) <= 0.02 * len(excess)


def test_gate_network_folds_constants():
    net = GateNetwork()
    a, b = net.source(), net.source()
    ands = net.and_(a, FALSE), net.and_(TRUE, b), net.and_(a, net.not_(a))
    assert (*ands, net.or_(a, net.not_(a))) == (FALSE, b, FALSE, TRUE)
    xors = net.xor(a, a), net.xor(net.not_(a), a), net.xor(TRUE, b)
    assert xors == (FALSE, TRUE, net.not_(b))
    muxes = net.mux(a, TRUE, FALSE), net.mux(a, b, b), net.mux(TRUE, a, b)
    assert muxes == (net.not_(a), b, b)
    assert net.tables([TRUE, FALSE, a]) == 0


@pytest.mark.parametrize("width", [1, 4, 6])
def test_gate_network_adds_all_numbers(width):
    """Of all numbers, by folding constants only."""
    net = GateNetwork()
    for x, y, carry in product(range(2**width), range(2**width), (FALSE, TRUE)):
        a, b = ([TRUE if n >> i & 1 else FALSE for i in range(width)] for n in (x, y))
        total = sum((bit == TRUE) << i for i, bit in enumerate(net.add(a, b, carry)))
        assert total == x + y + (carry == TRUE)


def test_inverted_output_costs_a_separate_table():
    net = GateNetwork()
    a, b = net.source(), net.source()
    gate = net.and_(a, b)
    wanted = [net.not_(a)], [net.not_(gate)], [gate, net.not_(gate)]
    assert [net.tables(signals) for signals in wanted] == [1, 1, 2]
