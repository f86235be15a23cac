"""Proofs about context tables agree with single observations."""

from hypothesis import given
from hypothesis import strategies as st

from mutator.stpa.context_coverage_proof import measure_coverage
from mutator.triggers.conditions import canonical_condition, evaluate_condition

NUMBERS = st.sampled_from([-1.0, 0.0, 0.5, 2.0])
COMPARISON = st.builds(
    lambda name, sign, number: f"{name} {sign} {number!r}",
    st.sampled_from(["hwt", "rs", "v_ego"]),
    st.sampled_from(["<", "<=", ">", ">=", "==", "!="]),
    NUMBERS,
)
CONDITION = st.recursive(
    COMPARISON,
    lambda inner: (
        st.builds("({} and {})".format, inner, inner)
        | st.builds("({} or {})".format, inner, inner)
        | st.builds("not ({})".format, inner)
    ),
    max_leaves=4,
)
ANYWHERE = NUMBERS | st.floats(allow_nan=False)


def contexts_at(conditions: dict[str, str], hwt: float, rs: float, v_ego: float) -> tuple[str, ...]:
    values = {"hwt": hwt, "rs": rs, "v_ego": v_ego}
    return tuple(row for row, condition in conditions.items() if evaluate_condition(condition, values))


@given(CONDITION, CONDITION, ANYWHERE, ANYWHERE, ANYWHERE)
def test_a_proved_table_has_one_context_for_every_observation(
    first: str, second: str, hwt: float, rs: float, v_ego: float
) -> None:
    texts = {"A": first, "B": f"not ({first}) and ({second})", "C": f"not ({first}) and not ({second})"}
    right = {row: canonical_condition(text) for row, text in texts.items()}
    assert measure_coverage(right).first_gap_or_overlap is None
    assert len(contexts_at(right, hwt, rs, v_ego)) == 1
    loose = {"A": canonical_condition(first), "B": canonical_condition(second)}
    if len(contexts_at(loose, hwt, rs, v_ego)) != 1:
        assert measure_coverage(loose).first_gap_or_overlap is not None
