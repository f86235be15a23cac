"""Shards: a plan's chunks distributed to several independent machines."""

import re
from dataclasses import dataclass

from mutator.errors import MutatorError


@dataclass(frozen=True, slots=True)
class Shard:
    """Share `number` of `shard_count`; numbers start at 1.

    It has every `shard_count`-th chunk, so that it is representative.
    """

    number: int
    shard_count: int

    @classmethod
    def parse(cls, text: str) -> "Shard":
        """Parse `k/n` from the command line; MutatorError for anything else."""
        match = re.fullmatch(r"([1-9]\d{0,5})/([1-9]\d{0,5})", text)
        if not match or int(match[1]) > int(match[2]):
            raise MutatorError(
                repr(text),
                argument="shard",
                expected="k/n, the k-th of n shares, such as 1/3",
            )
        return cls(int(match[1]), int(match[2]))

    def has_chunk(self, chunk: int) -> bool:
        """Return whether the chunk of this index (from 0) belongs to this share."""
        return chunk % self.shard_count == self.number - 1
