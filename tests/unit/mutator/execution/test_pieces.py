"""How work is cut into pieces, and which piece a worker gets."""

from mutator.execution.pieces import cut_into_pieces, take_piece_for


def test_a_piece_has_one_golden_run() -> None:
    """No piece mixes golden runs, and the last ones are single experiments, which even the load."""
    assert cut_into_pieces("A" * 10 + "B" * 3, str, 1) == [
        list(piece) for piece in ("AAAA", "AAA", "AA", "A", "B", "B", "B")
    ]
    assert list(map(len, cut_into_pieces("A" * 4, str, 2))) == [1, 1, 1, 1]
    assert max(map(len, cut_into_pieces("A" * 1000, str, 2))) == 20


def test_pieces_keep_the_order_of_the_work() -> None:
    """Nothing is lost, and an engine that goes on in a golden run goes on forwards."""
    pieces = cut_into_pieces(range(97), lambda number: number // 30, 2)
    assert [number for piece in pieces for number in piece] == list(range(97))


def test_a_worker_goes_on_with_the_golden_run_that_it_has() -> None:
    """A fork server that waits in a golden run is used further, if anything is left for it."""
    pieces = list("AABB")
    assert [take_piece_for(key, pieces, str) for key in ("", "A", "B", "A")] == ["A", "A", "B", "B"]
