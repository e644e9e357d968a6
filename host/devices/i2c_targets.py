"""Names and I2C addresses of what devices have on their bus."""

from collections.abc import Iterable, Sequence

from cubestack.host.devices.device import AnyDevice


def i2c_targets(
    devices: Iterable[AnyDevice], moves: Sequence[tuple[int, int]] = ()
) -> list[tuple[str, int]]:
    """Each device's node, and its registers behind another address.

    ``moves``: pairs of an old and a new address.
    """
    now = dict(moves)
    found = []
    for one in devices:
        if not one.interface.messages:
            continue  # a part, which has no address of its own
        found.append((one.name, one.interface.i2c_address))
        if one.interface.registers is not None:
            found.append((f"{one.name}-registers", one.interface.registers.i2c_address))
    return [(name, now.get(address, address)) for name, address in found]
