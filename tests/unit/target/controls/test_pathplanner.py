"""The path planner estimates lane width, line probabilities and the path between the lines."""

import pytest
from selfdrive.controls.lib.pathplanner import ModelFit, PathPlanner
from selfdrive.messages import LeadVision, ModelData, PathData


def line(y: float, prob: float = 1.0) -> PathData:
    return PathData((y,) * 50, prob, 1.0)


def model(
    left: float = 1.85, right: float = -1.85, path: float = 0.0, probs: tuple[float, float] = (1.0, 1.0)
):
    return ModelData(0.0, line(path), line(left, probs[0]), line(right, probs[1]), LeadVision(50.0, 1.0, 0.1))


def planned(*models: ModelData, v_ego: float = 20.0) -> PathPlanner:
    planner = PathPlanner(ModelFit())
    for m in models:
        planner.update(v_ego, m)
    return planner


def test_the_path_is_the_middle_of_the_lane() -> None:
    planner = planned(model(2.05, -1.65, 0.2))
    assert planner.d_poly == pytest.approx((0.0, 0.0, 0.0, 0.2), abs=1e-9)
    assert (planner.lanes.left_prob, planner.lanes.right_prob) == (1.0, 1.0)
    assert planner.c_prob == 1.0


def test_the_lane_and_the_model_path_have_equal_weight() -> None:
    assert planned(model(path=0.6)).d_poly[3] == pytest.approx(0.3)


def test_without_lines_the_model_path_is_followed() -> None:
    planner = planned(model(path=0.6, probs=(0.0, 0.0)))
    assert planner.d_poly[3] == pytest.approx(0.6)
    assert planner.c_prob == 0.0


def test_two_uncertain_lines_have_a_higher_combined_weight() -> None:
    planner = planned(model(path=0.7, probs=(0.5, 0.5)))
    assert planner.c_prob == pytest.approx(0.75)
    assert planner.d_poly[3] == pytest.approx(0.7 / 1.75)


def test_one_line_gives_the_middle_of_the_lane() -> None:
    planner = planned(model(left=2.0, right=-5.0, path=0.0, probs=(1.0, 0.0)))
    assert planner.c_poly[3] == pytest.approx(2.0 - planner.lane_width / 2.0)


@pytest.mark.parametrize(("width", "prob"), [(3.7, 1.0), (3.9, 1.0), (4.35, 0.504), (4.8, 0.0), (2.6, 0.0)])
def test_the_right_line_is_less_probable_if_the_width_is_unusual(width: float, prob: float) -> None:
    assert planned(model(right=1.85 - width)).lanes.right_prob == pytest.approx(prob, abs=0.005)


def test_the_width_is_learnt_slowly() -> None:
    assert planned(model(left=1.95, right=-1.95)).lane_width == pytest.approx(3.7 + 0.005 * 0.2)
    assert planned(*[model(left=1.95, right=-1.95) for _ in range(200)]).lane_width == pytest.approx(
        3.9 - 0.2 * 0.995**200
    )


def test_without_lines_the_width_approaches_the_usual_one() -> None:
    """The usual width depends on the speed."""
    blind = [model(probs=(0.0, 0.0)) for _ in range(200)]
    assert planned(*blind[:10], v_ego=31.0).lane_width == pytest.approx(3.8 - 0.1 * 0.95**10)
    assert planned(*blind, v_ego=31.0).lane_width == pytest.approx(3.8, abs=1e-3)
    assert planned(*blind, v_ego=0.0).lane_width == pytest.approx(3.0, abs=1e-3)


def test_the_width_is_not_learnt_from_one_line() -> None:
    one = [model(probs=(1.0, 0.0)) for _ in range(10)]
    assert planned(*one, v_ego=31.0).lane_width == pytest.approx(3.8 - 0.1 * 0.95**10)


def test_each_message_is_fitted_again() -> None:
    fit = ModelFit()
    assert fit.polys(model(path=0.1))[2][3] == pytest.approx(0.1)
    assert fit.polys(model(path=0.2))[2][3] == pytest.approx(0.2)
