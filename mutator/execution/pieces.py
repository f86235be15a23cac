"""Pieces: parts of ordered work that are dealt to workers, each with one golden run."""

from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

_PIECES_PER_WORKER = 4  # of what is left: more even the load, fewer share more work
_MOST_IN_PIECE = 20

_Work = TypeVar("_Work")


def cut_into_pieces(
    work: Sequence[_Work], golden_key_of: Callable[[_Work], Hashable], worker_count: int
) -> list[list[_Work]]:
    """Cut work, which is in order of scenario and start, into pieces with one golden run each.

    Pieces become smaller towards the end, so that all workers finish at about the same time.
    """
    pieces: list[list[_Work]] = []
    most = 0
    for position, part in enumerate(work):
        last = pieces[-1] if pieces else []
        if last and len(last) < most and golden_key_of(last[0]) == golden_key_of(part):
            last.append(part)
        else:
            remaining = len(work) - position
            most = max(1, min(_MOST_IN_PIECE, -(-remaining // (worker_count * _PIECES_PER_WORKER))))
            pieces.append([part])
    return pieces


_Piece = TypeVar("_Piece")


def take_piece_for(
    golden_key: Hashable, pieces: list[_Piece], golden_key_of: Callable[[_Piece], Hashable]
) -> _Piece:
    """Remove and return the next piece with the golden run that a worker has in memory, or else the next."""
    matching = (i for i, piece in enumerate(pieces) if golden_key_of(piece) == golden_key)
    return pieces.pop(next(matching, 0))
