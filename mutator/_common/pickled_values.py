"""What a process passes to those that it starts."""

import pickle
from typing import Self


class PickledValue:
    """A value that a process gets in bytes from the one that started it."""

    __slots__ = ()

    def to_bytes(self) -> bytes:
        return pickle.dumps(self)

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Return what `to_bytes` packed. The data must come from the process that started this one."""
        value = pickle.loads(data)
        assert isinstance(value, cls)
        return value
