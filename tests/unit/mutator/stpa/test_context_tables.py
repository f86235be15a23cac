"""Context tables."""

import math
import re
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Hold, Trigger
from mutator.stpa.context_tables import load_context_table
from mutator.triggers.conditions import evaluate_condition
from mutator.workspace import Workspace


def test_rows_become_triggers(toy: Workspace) -> None:
    near, far = toy.context_table("pedals").triggers(hold_s=3.0, armed_after_s=1.5)
    assert near == Trigger(name="near", condition="hwt <= 2.0", hold=Hold.FOR, hold_s=3.0, armed_after_s=1.5)
    assert far.condition == "not hwt <= 2.0"
    (only,) = toy.context_table("pedals").triggers(rows=("far",))
    assert only.name == "far" and only.hold is Hold.WHILE


def test_an_unknown_row_is_refused(toy: Workspace) -> None:
    with pytest.raises(MutatorError, match="context 'C1'; expected one of near, far"):
        toy.context_table("pedals").triggers(rows=("C1",))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("when: hwt <= safe_hwt_s", "when: hwt", "6: 'hwt' is not a truth value"),
        ("safe_hwt_s: 2.0", "t: 2.0", "3: constant 't'; expected a name other than 't'"),
        ("safe_hwt_s: 2.0", "safe_hwt_s: two", "3: 'two' for 'safe_hwt_s'; expected a number"),
        ("provided: H1,", "provided: 1,", "9: 1 for 'provided'; expected text"),
    ],
)
def test_a_mistake_in_a_table_is_reported(toy: Workspace, old: str, new: str, said: str) -> None:
    path = toy.library / "stpa" / "contexts" / "pedals.yaml"
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        load_context_table(path)
    assert said in str(caught.value).replace(f"{path}:", "")


def test_an_unknown_name_in_a_row_is_reported(toy: Workspace) -> None:
    path = toy.library / "stpa" / "contexts" / "pedals.yaml"
    path.write_text(path.read_text().replace("when: hwt <= safe_hwt_s", "when: hwt <= safe", 1))
    table, variables = load_context_table(path), toy.manifest("toy").observation.variables
    with pytest.raises(
        MutatorError, match=r"pedals.yaml:6: unknown name 'safe' in 'hwt <= safe'; .*: t, d_rel"
    ):
        table.check_variables(variables)


def test_the_shipped_table_covers_every_situation_exactly_once(clone: Workspace) -> None:
    table = clone.context_table("accelerate_decelerate")
    triggers = table.triggers()
    assert [t.name for t in triggers] == ["C1", "C2", "C3", "C4"]
    for d_rel in (10.0, 40.0, 60.0, 200.0):
        for v_ego in (0.0, 10.0, 20.0, 30.0):
            for v_lead in (0.0, 10.0, 20.0, 30.0):
                hwt = d_rel / v_ego if v_ego else math.inf
                values = {"hwt": hwt, "rs": v_ego - v_lead}
                assert sum(evaluate_condition(t.condition, values) for t in triggers) == 1
    cells = {
        (row.id, action): (v.provided, v.not_provided)
        for row in table.rows
        for action, v in row.hazards_by_action.items()
        if v.provided or v.not_provided
    }
    assert cells == {
        ("C2", "accelerate"): ("H1", None),
        ("C2", "decelerate"): (None, "H1"),
        ("C3", "accelerate"): (None, "H2"),
        ("C3", "decelerate"): ("H2", None),
        ("C4", "accelerate"): ("H1", None),
        ("C4", "decelerate"): (None, "H1"),
    }


def test_the_safe_headway_is_read_from_the_table(clone: Workspace, tmp_path: Path) -> None:
    text = (clone.library / "stpa" / "contexts" / "accelerate_decelerate.yaml").read_text()
    path = tmp_path / "wide.yaml"
    path.write_text(text.replace("safe_hwt_s: 2.0", "safe_hwt_s: 3"))
    assert load_context_table(path).rows[1].condition == "hwt <= 3.0 and rs > 0.0"


def test_the_table_in_the_docs_is_valid_and_complete(clone: Workspace, tmp_path: Path) -> None:
    page = clone.library.parent / "docs" / "how-to" / "change-the-hazard-analysis.md"
    (text, *_) = re.findall(r"```yaml\n(.*?)```", page.read_text(), re.DOTALL)
    (tmp_path / "closing.yaml").write_text(text)
    table = load_context_table(tmp_path / "closing.yaml")
    assert [row.id for row in table.rows] == ["slow", "fast_near", "fast_far"]
    assert table.coverage.cell_count == 9 and table.coverage.no_proof_reason is None


def test_rows_with_different_actions_are_refused(toy: Workspace) -> None:
    path = toy.library / "stpa" / "contexts" / "pedals.yaml"
    head, _, tail = path.read_text().rpartition("accelerate:")
    path.write_text(f"{head}brake:{tail}")
    with pytest.raises(MutatorError, match=r"pedals.yaml:13: actions brake in context 'far'"):
        load_context_table(path)


def test_a_table_that_compares_two_variables_is_accepted_without_a_proof(toy: Workspace) -> None:
    path = toy.library / "stpa" / "contexts" / "pedals.yaml"
    path.write_text(path.read_text().replace("hwt <= safe_hwt_s", "v_ego <= v_lead"))
    table = load_context_table(path)
    assert table.coverage.cell_count == 0
    assert table.coverage.no_proof_reason == (
        "a condition compares 'v_ego' with 'v_lead'; only comparisons of one variable with a constant can be "
        "tested"
    )
