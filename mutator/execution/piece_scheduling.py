"""How pytest-xdist deals a campaign's items: in pieces, each with one golden run.

A worker goes on with the golden run that it has in memory, so its engine can go on where it is. While checks
remain, a piece waits for those of its golden run, and a run of a check takes the place of a worker.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import Any, Protocol

import pytest
from xdist.scheduler import LoadScheduling

from mutator.execution.pieces import cut_into_pieces, take_piece_for

# A user's choice, which is followed. The other ones keep the items of a file together, or repeat all items.
_CHOICES = ("load", "loadgroup", "worksteal")
_LEAST_PENDING = 2  # a worker begins an item when it knows the next one


def is_scheduler_chosen(config: pytest.Config) -> bool:
    """Whether the user has named a `--dist` that suits a campaign."""
    return getattr(config.known_args_namespace, "dist", "no") in _CHOICES


class DealtChecks(Protocol):
    """Checks that experiments do not all wait for."""

    @property
    def running(self) -> int: ...

    @property
    def has_waiting(self) -> bool: ...

    def start_next(self) -> None: ...


class PieceScheduling(LoadScheduling):  # type: ignore[misc]  # xdist has no types
    """Deals pieces of items. `golden_key_of` returns what items of a piece have in common, by node id.

    `checks` returns the checks that remain, or None; `is_checked` tells whether items with such a key can
    run.
    """

    collection: list[str] | None

    def __init__(
        self,
        config: pytest.Config,
        log: Any,
        golden_key_of: Callable[[str], Hashable],
        checks: Callable[[], DealtChecks | None] = lambda: None,
        is_checked: Callable[[Hashable], bool] = lambda golden_key: True,
    ) -> None:
        super().__init__(config, log)
        self._checks, self._is_checked = checks, is_checked
        self._golden_key_of = golden_key_of
        self._pieces: list[list[int]] = []
        self._golden_key_by_worker: dict[Any, Hashable] = {}

    def schedule(self) -> None:
        """Deal the first pieces, in turn, or, to workers that came later, the next ones."""
        is_first = self.collection is None
        if is_first and not self._check_nodes_have_same_collection():
            return
        if is_first:
            self.collection = next(iter(self.node2collection.values()))
            self._put_back(range(len(self.collection)))
        self.deal()
        if self.collection and not self.pending:
            for node in self.nodes:
                node.shutdown()

    def check_schedule(self, node: Any, duration: float = 0) -> None:
        """Deal the next pieces to a worker that is about to wait for them."""
        if node.shutting_down:
            return
        self.deal()
        if not self.pending:
            node.shutdown()

    def deal(self) -> None:
        """Deal what can run, in turn, to workers that are about to wait, or begin checks in their place."""
        has_dealt = True
        while has_dealt:
            has_dealt = False
            for node in self.nodes:
                has_dealt |= not self._has_enough(node) and self._serve(node)

    def _serve(self, node: Any) -> bool:
        """Send a worker the next piece, or begin a check in its place; return whether there was any.

        While checks remain, only one worker runs experiments: it soon has a verdict, and a check that fails
        is known early.
        """
        checks = self._checks()
        is_any_open = any(map(self._is_open, self._pieces))
        if checks is None:
            return self._send_piece_if(node, is_any_open)
        busy_count = sum(map(self._has_enough, self.nodes))
        if busy_count + checks.running >= len(self.nodes):
            return False
        if checks.has_waiting and (busy_count or not is_any_open):
            checks.start_next()
            return True
        return self._send_piece_if(node, is_any_open)

    def _send_piece_if(self, node: Any, is_any_open: bool) -> bool:
        if is_any_open:
            self._send_piece(node)
        return is_any_open

    def _is_open(self, piece: Sequence[int]) -> bool:
        return self._is_checked(self._key_of_index(piece[0]))

    def mark_test_pending(self, item: str) -> None:
        """Deal an item again."""
        assert self.collection is not None
        self._put_back([self.collection.index(item)])
        for node in self.nodes:
            self.check_schedule(node)

    def remove_node(self, node: Any) -> str | None:
        """Forget a worker; return the item that it ran when it died, and deal the others again."""
        indices: list[int] = self.node2pending.pop(node)
        if not indices:
            return None
        assert self.collection is not None
        self._put_back(indices[1:])
        for other in self.nodes:
            self.check_schedule(other)
        return self.collection[indices[0]]

    def _has_enough(self, node: Any) -> bool:
        return len(self.node2pending[node]) >= _LEAST_PENDING or node.shutting_down

    def _put_back(self, indices: Sequence[int]) -> None:
        self._pieces += cut_into_pieces(indices, self._key_of_index, len(self.nodes) or 1)
        self.pending.extend(indices)

    def _key_of_index(self, index: int) -> Hashable:
        assert self.collection is not None
        return self._golden_key_of(self.collection[index])

    def _send_piece(self, node: Any) -> None:
        golden_key = self._golden_key_by_worker.get(node)
        pieces = [piece for piece in self._pieces if self._is_open(piece)]
        piece = take_piece_for(golden_key, pieces, lambda piece: self._key_of_index(piece[0]))
        self._pieces.remove(piece)
        self._golden_key_by_worker[node] = self._key_of_index(piece[-1])
        sent = set(piece)
        self.pending[:] = [index for index in self.pending if index not in sent]
        self.node2pending[node].extend(piece)
        node.send_runtest_some(piece)
