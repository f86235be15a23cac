"""Errors that a user can mend."""


class ConfigError(Exception):
    """A wrong input file. The text reads `file:line: got, expected, remedy`."""

    def __init__(
        self, got: str, *, where: str = "", line: int | None = None, expected: str, remedy: str
    ) -> None:
        place = f"{where}:{line}: " if line is not None else f"{where}: " if where else ""
        super().__init__(f"{place}{got}, expected {expected}; {remedy}")
