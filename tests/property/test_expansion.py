"""Expansion: values depend only on seed, key and range."""

from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from mutator.faults.draw_specs import DrawSpec
from mutator.faults.spec_expansion import draw_values, expand_spec
from mutator.model import Fault
from mutator.workspace import Workspace

CLONE = Workspace.find(root=Path(__file__).parents[2])
MANIFEST, MODELS, SPECS = CLONE.manifest("openpilot"), CLONE.fault_models(), CLONE.specs()
SEEDS = st.integers(0, 2**63 - 1)
RANGES = st.lists(
    st.tuples(st.integers(-1000, 1000), st.integers(0, 100)).map(lambda p: (float(p[0]), float(p[0] + p[1]))),
    min_size=1,
    max_size=30,
).map(tuple)


def library(seed: int, reading: str) -> list[Fault]:
    return [f for s in SPECS for f in expand_spec(s, seed, reading, models=MODELS, manifest=MANIFEST)]


@settings(max_examples=100, deadline=None)
@given(
    SEEDS,
    st.text(max_size=20),
    RANGES,
    st.sampled_from(["integers", "reals"]),
    st.none() | st.integers(-5, 5),
)
def test_draws_lie_in_their_ranges(
    seed: int, key: str, ranges: tuple[tuple[float, float], ...], kind: str, cap: int | None
) -> None:
    draw = DrawSpec(key=key, name="x", unit="m", kind=kind, ranges=ranges, decimals=None, cap=cap)
    values = draw_values(draw, seed)
    assert len(values) == len(ranges)
    for value, (low, high) in zip(values, ranges, strict=True):
        assert value == cap or low <= value <= high
        assert cap is None or value <= cap
        assert isinstance(value, int) == (kind == "integers")
    assert values == draw_values(draw, seed)


@settings(max_examples=100, deadline=None)
@given(SEEDS, st.integers(1, 4))
def test_values_are_unique_and_not_zero(seed: int, decimals: int) -> None:
    ranges = tuple((-2.5 + 0.5 * i, -1.5 + 0.5 * i) for i in range(10))
    draw = DrawSpec(key="k", name="x", unit="m", kind="reals", ranges=ranges, decimals=decimals)
    values = draw_values(draw, seed)
    assert len(set(values)) == 10 and 0.0 not in values


@settings(max_examples=50, deadline=None)
@given(SEEDS, RANGES, st.integers(1, 29))
def test_more_ranges_do_not_change_earlier_values(
    seed: int, ranges: tuple[tuple[float, float], ...], count: int
) -> None:
    whole = DrawSpec(key="k", name="x", unit="m", kind="reals", ranges=ranges)
    part = DrawSpec(key="k", name="x", unit="m", kind="reals", ranges=ranges[:count])
    assert draw_values(part, seed) == draw_values(whole, seed)[:count]


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_both_readings_have_the_same_values(seed: int) -> None:
    described, coded = library(seed, "as_described"), library(seed, "as_coded")
    assert [(f.spec, f.value, f.unit) for f in described] == [(f.spec, f.value, f.unit) for f in coded]
    assert len({f.id for f in (*described, *coded)}) == 2 * sum(spec.fault_count for spec in SPECS)


@settings(max_examples=10, deadline=None)
@given(SEEDS, st.permutations(SPECS), st.sampled_from(CLONE.readings().names))
def test_the_order_of_specs_does_not_matter(seed: int, specs: list, reading: str) -> None:
    found = {f.id for s in specs for f in expand_spec(s, seed, reading, models=MODELS, manifest=MANIFEST)}
    assert found == {f.id for f in library(seed, reading)}
