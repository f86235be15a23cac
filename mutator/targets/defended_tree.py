"""A target's tree with defences in it."""

from dataclasses import dataclass

from mutator.targets.source_tree import SourceTree


@dataclass(frozen=True, slots=True, kw_only=True)
class DefendedTree:
    """`tree` has the lines and files of the `defences`, which are named in the order in which they act."""

    defences: tuple[str, ...]
    tree: SourceTree
