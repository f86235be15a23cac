"""Fault models: their templates, their schema, and their examples, which serve as tests."""

import shutil
from pathlib import Path

import pytest

from mutator.checks.library_check import apply_example, example_problems
from mutator.errors import MutatorError
from mutator.faults.fault_model_files import load_fault_models
from mutator.faults.fault_models import SnippetKind
from mutator.workspace import Workspace

NAMES = [
    "bit_flip",
    "byte_corruption",
    "clamp",
    "delay",
    "drift",
    "exception",
    "ghost_object",
    "image_effect",
    "infinity",
    "message_delay",
    "message_freeze",
    "message_loss",
    "message_reordering",
    "message_repetition",
    "nan",
    "noise",
    "none",
    "offset",
    "omission",
    "quantise",
    "reordering",
    "repetition",
    "scale",
    "sign_flip",
    "slow_call",
    "stale",
    "stuck",
    "swapped_arguments",
    "unit_mix_up",
    "waveform",
    "wrong_branch",
]
OF_OPERATORS = [
    f"operator_{name}" for name in ("constant", "drop", "empty", "infix", "name", "prefix", "swap")
]
RAISING = ["exception", "reordering", "repetition", "slow_call", "swapped_arguments", *OF_OPERATORS]


@pytest.fixture
def folder(tmp_path: Path, clone: Workspace) -> Path:
    return Path(shutil.copytree(clone.templates, tmp_path / "templates"))


def broken(folder: Path, name: str, old: str, new: str) -> str:
    path = folder / name
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        load_fault_models(folder)
    return str(caught.value).replace(f"{path}:", "")


def test_the_expected_models_are_shipped(clone: Workspace) -> None:
    models = clone.fault_models()
    assert list(models.models) == sorted(NAMES + OF_OPERATORS)
    assert [m.name for m in models if m.kind is SnippetKind.GUARD] == ["omission", "reordering"]
    assert all(m.examples and m.about for m in models)


@pytest.mark.parametrize("name", NAMES + OF_OPERATORS)
def test_the_examples_of_each_model_give_the_expected_code(clone: Workspace, name: str) -> None:
    models = clone.fault_models()
    model = models.get(name)
    for example in model.examples:
        assert apply_example(model, models, example) == example.after


def test_the_digest_depends_on_which_models_raise_on_purpose(folder: Path, clone: Workspace) -> None:
    """Verdicts depend on which models can raise an exception on purpose."""
    known = clone.fault_models()
    assert [model.name for model in known if model.raises] == sorted(RAISING)
    path = folder / "scale.yaml"
    path.write_text(path.read_text().replace("kind: insert\n", "kind: insert\nraises: false\n"))
    assert load_fault_models(folder).digest == known.digest
    path.write_text(path.read_text().replace("raises: false\n", "raises: true\n"))
    models = load_fault_models(folder)
    assert [model.name for model in models if model.raises] == sorted([*RAISING, "scale"])
    assert models.digest != known.digest


def test_a_wrong_example_is_reported_with_its_line(folder: Path) -> None:
    path = folder / "scale.py.j2"
    path.write_text(path.read_text().replace(" * ", " / "))
    (problem,) = example_problems(load_fault_models(folder))
    assert problem.where == str(folder / "scale.yaml") and problem.line == 12
    assert all(f"self.yaw_rate {sign} _fi.like(" in str(problem) for sign in "*/")


def test_a_template_that_does_not_parse_is_reported(folder: Path) -> None:
    (folder / "scale.py.j2").write_text("if {{ target:\n")
    (problem,) = example_problems(load_fault_models(folder))
    assert "scale.yaml:12: the example fails" in str(problem) and "scale.py.j2:1: the template fails" in str(
        problem
    )


def test_the_digest_covers_everything_that_determines_a_mutant(folder: Path) -> None:
    before = load_fault_models(folder).digest
    for name in ("offset.py.j2", "_fi.py.j2"):
        (folder / name).write_text((folder / name).read_text() + "\n")
        after = load_fault_models(folder).digest
        assert after != before
        before = after


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("scale.yaml", "name: scale", "name: times", "2: 'times'; expected 'scale', the name of the file"),
        (
            "scale.yaml",
            "kind: insert",
            "kind: wrap",
            "3: 'wrap' for 'kind'; expected one of 'insert', 'guard'",
        ),
        ("scale.yaml", "type: number", "type: float", "8: 'float' for 'type'; expected one of 'variable'"),
        ("scale.yaml", "factor:", "left:", "8: parameter 'left'; expected a name other than these"),
        ("scale.yaml", "factor:", "factor_m:", "8: parameter 'factor_m'; expected an identifier without"),
        (
            "wrong_branch.yaml",
            "choices: [inverted, always, never], ",
            "",
            "8: parameter 'holds' of type choice has no `choices`; expected `choices` for a choice",
        ),
        ("slow_call.yaml", "needs: call", "needs: rest", "4: 'rest' for 'needs'; expected one of 'call'"),
        ("offset.yaml", "unit: target", "unit: feet", "9: 'feet'; expected target or one of m, mm, cm"),
        ("scale.yaml", "examples:", "samples:", "11: unknown key 'samples'"),
        (
            "scale.yaml",
            "before: |",
            "befor: |",
            "unknown key 'befor'; expected one of about, injection, before",
        ),
    ],
)
def test_a_mistake_in_a_models_yaml_is_reported(
    folder: Path, name: str, old: str, new: str, said: str
) -> None:
    assert said in broken(folder, name, old, new)


def test_the_error_names_a_missing_template(folder: Path) -> None:
    (folder / "scale.py.j2").unlink()
    with pytest.raises(MutatorError, match=r"scale.py.j2: cannot be read"):
        load_fault_models(folder)


def test_a_folder_without_models_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="no fault model"):
        load_fault_models(tmp_path)
