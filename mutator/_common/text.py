"""Words for people."""


def counted(count: int, noun: str, plural: str = "") -> str:
    """A number of things: 1 run, 2 runs; `plural` where it is not the noun and an s."""
    return f"{count} {noun}" if count == 1 else f"{count} {plural or noun + 's'}"
