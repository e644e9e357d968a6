"""Dataclasses whose fields are declared values."""

from dataclasses import field, replace
from typing import Any, ClassVar

from cubestack.firmware_model.values.declaration import REQUIRED, Declaration
from cubestack.firmware_model.values.tables import named


class DeclaredValues:
    """Base of frozen dataclasses that check their declared values on construction.

    A field is declared by a `Declaration` as its default, as in
    ``rate: float = number(1.0, "share of the bytes", 0, 1)``. Other fields are left alone.

    Attributes:
        error: raised for a value that is not allowed.
    """

    error: ClassVar[type[ValueError]] = ValueError
    _declared: ClassVar[dict[str, Declaration]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        own = {name: one for name, one in vars(cls).items() if isinstance(one, Declaration)}
        cls._declared = {**cls._declared, **named(own)}
        for name, one in own.items():
            setattr(cls, name, field() if one.default is REQUIRED else field(default=one.default))

    def __post_init__(self) -> None:
        """Check every value."""
        for one in self._declared.values():
            self._check(one)

    @classmethod
    def declared(cls) -> dict[str, Any]:
        """The declarations by name, in the order of the fields."""
        return cls._declared

    @classmethod
    def refusal(cls, name: str, text: str) -> ValueError:
        """The error for the value ``name``, of which ``text`` says what it must be."""
        return cls.error(f"{name} {text}")

    def check_within(self, name: str, **limits: float) -> None:
        """Check a value against a ``low`` or ``high`` that depends on other values."""
        self._check(replace(self._declared[name], **limits))  # type: ignore[arg-type]

    def _check(self, one: Declaration) -> None:
        try:
            one.check(getattr(self, one.name))
        except ValueError as error:
            raise self.refusal(one.name, str(error)) from None
