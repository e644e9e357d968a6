"""A message's bytes, derived from the declaration of its fields: one struct, and single bits."""

import struct
from collections.abc import Mapping

from cubestack.firmware_model.interface.codec.field import Field, Value


class Layout:
    """Packs and unpacks the values of ``fields``, which have their places in ``length`` bytes.

    Attributes:
        names: of the fields, in their order.
    """

    def __init__(self, fields: tuple[Field, ...], length: int, *, saturate: bool) -> None:
        """``saturate``: as in ``Field.count``."""
        self._fields, self._length, self._saturate = fields, length, saturate
        self._unset: dict[str, Value] = {field.name: 0 for field in fields}
        self.names = self._unset.keys()
        numbers = [field for field in fields if field.type != "bool1"]
        form, end = "<", 0
        for field in numbers:
            form += f"{field.byte_offset - end}x{field.item}"
            end = field.byte_offset + field.bits // 8
        self._struct = struct.Struct(f"{form}{length - end}x")
        self._numbers = [field.name for field in numbers]
        self._scales = [(field.name, field.scale) for field in numbers if field.scaled]
        self._masks = {f.name: 1 << f.bit_offset for f in fields if f.type == "bool1"}
        # Bytes of another length would be cut or padded; all other wrong values are refused.
        self._plain = not self._scales and not any(f.type.startswith("bytes") for f in numbers)

    def pack(self, values: Mapping[str, object]) -> bytes:
        """``length`` bytes with a value for each of ``names``; raises as ``Field.count``."""
        if self._plain:
            try:  # most values are counts already
                return self._packed(values)
            except (struct.error, TypeError, OverflowError):
                pass
        return self._packed(
            {f.name: f.count(values[f.name], saturate=self._saturate) for f in self._fields}
        )

    def _packed(self, counts: Mapping[str, object]) -> bytes:
        data = self._struct.pack(*[counts[name] for name in self._numbers])
        if not self._masks:
            return data
        whole = int.from_bytes(data, "little")
        for name, mask in self._masks.items():
            bit = counts[name]
            if bit != 0:
                if bit != 1:
                    raise TypeError(f"{bit!r} is no bit")
                whole |= mask
        return whole.to_bytes(self._length, "little")

    def unpack(self, data: bytes) -> dict[str, Value]:
        """Every field's value in ``data``, which must have ``length`` bytes."""
        values = dict(zip(self._numbers, self._struct.unpack(data), strict=True))
        for name, scale in self._scales:
            values[name] /= scale
        if not self._masks:
            return values
        whole = int.from_bytes(data, "little")
        return {**self._unset, **values, **{n: whole & m != 0 for n, m in self._masks.items()}}
