"""The columns of the results, which depend only on the manifest."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.results.table_columns import deviation_column_by_channel, result_columns
from mutator.workspace import Workspace

OF_OPENPILOT = (
    "experiment_id, fault_id, module, fault_type, reading, value, unit, scenario, method, trigger, seed, "
    "status, outcome, activated, t_activation, activations, manifested, t_manifest, h1, t_h1, h2, t_h2, "
    "h3, t_h3, h4, t_h4, alerts, t_alert, reaction_time, max_dev_gas, max_dev_brake, max_dev_steer, "
    "variant, aim, condition, hold, hold_s, first_actuator, first_change, first_change_share, detail"
)


def names(hazards: list[str], compared: list[str]) -> list[str]:
    return [column.name for column in result_columns(hazards, compared)]


def test_the_shipped_target_has_the_expected_columns_in_order(clone: Workspace) -> None:
    manifest = clone.manifest("openpilot")
    made = names(list(manifest.hazard_names), [channel.name for channel in manifest.compared_channels])
    assert ", ".join(made) == OF_OPENPILOT


def test_another_target_has_its_own_columns() -> None:
    made = names(["CRUSHED"], ["gripper_force"])
    at = made.index("t_manifest")
    assert made[at + 1 : at + 4] == ["crushed", "t_crushed", "alerts"]
    assert made[-10:-6] == ["max_dev_gripper", "variant", "aim", "condition"]
    assert not {"h1", "t_h1", "max_dev_gas", "max_dev_brake", "max_dev_steer"} & {*made}


def test_a_target_need_not_have_hazards() -> None:
    made = names([], [])
    assert made[made.index("t_manifest") + 1] == "alerts"
    assert not [name for name in made if name.startswith("max_dev_")]


def test_hazard_columns_keep_the_order_of_the_manifest() -> None:
    made = names(["H3", "TOO_FAST", "H1"], ["gas"])
    at = made.index("h3")
    assert made[at : at + 6] == ["h3", "t_h3", "too_fast", "t_too_fast", "h1", "t_h1"]


@pytest.mark.parametrize(
    ("channels", "columns"),
    [
        (["gas", "brake", "steer_torque"], ["max_dev_gas", "max_dev_brake", "max_dev_steer"]),
        (["gas_left", "gas_right", "horn"], ["max_dev_gas_left", "max_dev_gas_right", "max_dev_horn"]),
    ],
)
def test_deviation_columns_use_the_first_word_of_a_channel(channels: list[str], columns: list[str]) -> None:
    assert list(deviation_column_by_channel(channels).values()) == columns


@pytest.mark.parametrize(
    ("hazards", "at"),
    [
        ("[alert]", "alert"),  # t_alert is the column for the first alert's time
        ("[H1, Status]", "Status"),
        ("[max_dev_speed]", "max_dev_speed"),
        ("[hazard]", "hazard"),  # the column that says whether any hazard occurred
        ("[kind]", "kind"),
        ("[H1, t_h1]", "t_h1"),
    ],
)
def test_a_hazard_with_an_existing_column_is_refused(toy: Workspace, hazards: str, at: str) -> None:
    path = toy.library / "targets" / "toy.yaml"
    path.write_text(path.read_text().replace("hazards: [H1]", f"hazards: {hazards}"))
    with pytest.raises(
        MutatorError, match=rf"{Path(path).name}:26: hazard '{at}' clashes with another column"
    ):
        toy.manifest("toy")


@pytest.mark.parametrize(
    ("metrics", "at"),
    [
        (["t_h1"], "t_h1"),
        (["peak", "t_peak"], "t_peak"),  # the two columns together would look like a hazard
        (["t_peak", "peak"], "peak"),
        (["end"], "end"),  # the column t_end exists
    ],
)
def test_a_metric_with_an_existing_column_is_refused(toy: Workspace, metrics: list[str], at: str) -> None:
    path = toy.library / "targets" / "toy.yaml"
    lines = [f"  {name}: {{max: speed, unit: m/s, worse: higher, about: x}}" for name in metrics]
    path.write_text("\n".join([path.read_text().rstrip(), "metrics:", *lines, ""]))
    with pytest.raises(MutatorError, match=f"metric '{at}' clashes with another column"):
        toy.manifest("toy")


@pytest.mark.parametrize("name", ["h1", "H2", "too_fast"])
def test_hazard_names_without_an_existing_column_are_valid(toy: Workspace, name: str) -> None:
    path = toy.library / "targets" / "toy.yaml"
    path.write_text(path.read_text().replace("hazards: [H1]", f"hazards: [{name}]"))
    assert toy.manifest("toy").hazard_names == (name,)
