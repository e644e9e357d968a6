"""Settings out of range are refused where they are made."""


def check_bounds(settings: object, **bounds: tuple[float, float]) -> None:
    """Raise ValueError for an attribute that is neither None nor within its bounds."""
    for name, (low, high) in bounds.items():
        value = getattr(settings, name)
        if value is not None and not low <= value <= high:
            raise ValueError(f"{name} must be {low} to {high}, not {value}")
