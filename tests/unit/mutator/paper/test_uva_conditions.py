"""Conditions become triggers that hold in the same steps of 10 ms, and anything else is refused."""

import pytest

from mutator.paper.uva_conditions import parse_condition


@pytest.mark.parametrize(
    ("text", "when"),
    [
        ("self.headway_time>=0 and self.headway_time<=2.0", "hwt >= 0 and hwt <= 2"),
        ("not self.lead_relevancy", ""),
        ("not self.lead_relevancy and self.current_time()>2.0", "t > 2"),
        ("plant.current_time()>3.0", "t > 3"),
        ("self.frameIdx>=500.0 and self.frameIdx<=3000.0", "t >= 5 and t <= 30"),
        ("(self.frameIdx/100.0)>=5.0", "t >= 5"),
        ("tracks[ids].dRel>=200.0", "d_rel >= 200"),
        ("v_target<(v_cruise * CV.KPH_TO_MS)", ""),
        # Python 2 divides whole numbers without a fraction: 30 is up to the last step before 31 s
        ("(frame/100)>=7 and (frame/100)<=30", "t >= 7 and t < 31"),
        ("(md.model.frameId/100)>=3 and (md.model.frameId/100)<=30", "t >= 2.99 and t < 30.99"),
        ("frameIdx/100>=0 and frameIdx/100<=3", "t < 3.99"),
        # all digits, and no exponent
        ("self.headway_time<=0.000001", "hwt <= 0.000001"),
        ("self.headway_time<=1234.5678", "hwt <= 1234.5678"),
        ("self.headway_time<=1234.5679", "hwt <= 1234.5679"),
        ("self.headway_time<=999999.9", "hwt <= 999999.9"),
        ("self.frameIdx>=0.123456", "t >= 0.00123456"),
    ],
)
def test_a_condition_becomes_a_trigger(text: str, when: str) -> None:
    assert parse_condition(text).when == when


@pytest.mark.parametrize("first", range(2, 5))
def test_whole_seconds_of_a_counter_hold_in_the_same_steps(first: int) -> None:
    """A condition on whole seconds, evaluated as Python 2 does, agrees with its trigger in every step."""
    when = parse_condition(f"(frame/100)>={first} and (frame/100)<={first + 1}").when
    for step in range(700):
        holds = first <= step // 100 <= first + 1
        assert eval(when, {"t": step / 100}) == holds  # the trigger is ours, not a file's


def test_a_target_speed_is_compared_at_the_place() -> None:
    assert parse_condition("v_target<(v_cruise * CV.KPH_TO_MS)").where == "plan.source != 'cruise'"
    assert parse_condition("v_target>=(v_cruise * CV.KPH_TO_MS)").where == "plan.source == 'cruise'"


def test_a_free_road_is_a_need_of_the_fault() -> None:
    assert parse_condition("not self.lead_relevancy and self.current_time()<=3").needs_free_road
    assert not parse_condition("self.headway_time>=0").needs_free_road


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("__import__('os').system('true')", "a condition that is not understood: __import__"),
        ("self.secret>=1", "a value that is not observed: self.secret"),
        ("self.headway_time>=1 or True", "a condition that is not understood: self.headway_time>=1 or True"),
        ("self.headway_time>=1e999", "a condition that is not understood"),
        ("self.current_time()>\u0663", "a condition that is not understood"),
        ("True", "a condition that is not understood: True"),
    ],
)
def test_any_other_condition_is_refused(text: str, said: str) -> None:
    with pytest.raises(ValueError, match="not") as caught:
        parse_condition(text)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "self.headway_time>=2 and self.headway_time<=1.5",
        "self.headway_time>2 and self.headway_time<=2",
        "self.frameIdx>=500 and self.frameIdx<=400",
        "frameIdx/100<0",  # before the first step
        "(frame/100)>7 and (frame/100)<8",
        "self.current_time()>1.001 and self.current_time()<1.009",  # between two steps
    ],
)
def test_a_condition_that_never_holds_is_refused(text: str) -> None:
    """Its faults would all be inactive."""
    with pytest.raises(ValueError, match="a condition that never holds"):
        parse_condition(text)


def test_a_condition_that_holds_once_is_not_refused() -> None:
    assert parse_condition("self.headway_time>=2 and self.headway_time<=2").when == "hwt >= 2 and hwt <= 2"
    assert parse_condition("self.frameIdx>=29 and self.frameIdx<=29").when == "t >= 0.29 and t <= 0.29"
