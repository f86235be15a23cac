"""What fails in the code of another package is blamed on that package, never on the harness or the target."""

from collections.abc import Callable
from pathlib import Path

import pytest

import mutator
from mutator._common.extension_doors import ALL_DOORS, EXPORT_DOOR, OPERATOR_DOOR, STUDY_DOOR
from mutator.cli.app import main
from mutator.errors import EXIT_WRONG_INPUT, BadAddition, ResourceShortage
from mutator.execution.distributor_choice import choose_distributor
from mutator.report import report_builder
from mutator.workspace import Workspace

from ..report.made_run import make_run

CLONE = Path(__file__).parents[4]
SOURCE = """\
from mutator.execution.distributor_choice import DistributorKind
from mutator.exports import Export
from mutator.operators import Operator
from mutator.report.reported_run import PublishedWork

def fail(*_):
    raise ValueError("no luck")

class Failing:
    run = fail

TEXT = dict(about="", replacements=(), examples={})
OPERATORS = {
    "boom": Operator(**TEXT, rules=fail),
    "odd": Operator(**TEXT, rules=lambda *_: [3]),
    "leaves": Operator(**TEXT, omits=fail),
}
boom, odd, leaves = OPERATORS.values()
tally = Export(about="", file="tally.txt", write=fail)
words = Export(about="", file="words.txt", write=lambda _: "text")
shut = DistributorKind(about="", open=fail)
late = DistributorKind(about="", open=lambda *_: Failing())
panel = PublishedWork(about="", check=lambda _: (), published=fail, panels=(fail,), drawings=fail)
"""
ADDED = {
    "operators": ("boom", "odd", "leaves"),
    "exports": ("tally", "words"),
    "distributors": ("shut", "late"),
    "studies": ("panel",),
}
NO_LUCK = "fails: ValueError: no luck"


@pytest.fixture(autouse=True)
def failing(tmp_path: Path, install: Callable[[Path], None]) -> None:
    """Install a package of which every addition fails when it is used."""
    project = tmp_path / "failing"
    project.mkdir()
    (project / "rvdoors.py").write_text(SOURCE)
    lines = ['[project]\nname = "rvdoors"\nversion = "0.3"']
    for group, names in ADDED.items():
        lines += [f'[project.entry-points."mutator.{group}"]', *(f'{one} = "rvdoors:{one}"' for one in names)]
    (project / "pyproject.toml").write_text("\n".join(lines))
    install(project)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("boom", f"operator 'boom' of package rvdoors 0.3 {NO_LUCK}"),
        ("leaves", f"operator 'leaves' of package rvdoors 0.3 {NO_LUCK}"),
        ("odd", "operator 'odd' of package rvdoors 0.3 fails: TypeError: 3 is no MutationRule"),
        ("all", f"operator 'boom' of package rvdoors 0.3 {NO_LUCK}"),
    ],
)
def test_an_operator_that_fails_ends_the_command_with_its_package(
    names: str, said: str, toycar: Workspace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root, out = str(toycar.library.parent), str(tmp_path / "mutants")
    words = ["--root", root, "generate", "--operators", names, "--in", "toycar/**", "--all-lines"]
    code = main([*words, "--out", out])
    told = " ".join(capsys.readouterr().err.split())
    assert code == EXIT_WRONG_INPUT
    assert f"{said} to do: correct or remove the package" in told and "bug in mutator" not in told


@pytest.mark.parametrize(
    ("name", "said"), [("tally", NO_LUCK), ("words", "fails: TypeError: `write` returns str, not bytes")]
)
def test_an_export_that_fails_is_named_with_its_package(
    name: str, said: str, toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    run = mutator.load_run(write_run(toycar, tmp_path / "run", lambda e: {}))
    with pytest.raises(BadAddition) as caught:
        run.export(name)
    assert f"export '{name}' of package rvdoors 0.3 {said}" in str(caught.value)
    assert not (run.path / "exports").exists()


def test_a_distributor_that_fails_is_named_with_its_package(toycar: Workspace, tmp_path: Path) -> None:
    with pytest.raises(
        BadAddition, match=f"rvdoors.py:7: distributor 'shut' of package rvdoors 0.3 {NO_LUCK}"
    ):
        choose_distributor("shut:")
    choices = mutator.Choices(only='fault_type == "lane"', limit=1)
    with pytest.raises(BadAddition, match=f"distributor 'late' of package rvdoors 0.3 {NO_LUCK}"):
        mutator.run("small", tmp_path / "run", choices=choices, cluster="late:", workspace=toycar)


def test_a_study_whose_panel_fails_is_named_with_its_package(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    with pytest.raises(BadAddition, match=f"study 'panel' of package rvdoors 0.3 {NO_LUCK}"):
        report_builder.write_report(make_run(run, study="panel"), Workspace.find(root=CLONE))


def test_only_the_code_of_other_packages_is_blamed() -> None:
    for door in ALL_DOORS:
        for name in (*door.shipped_names(), *(["driving_agent_resilience"] if door is STUDY_DOOR else [])):
            with pytest.raises(ZeroDivisionError), door.blaming_package(name):
                _ = 1 / 0


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt(), MemoryError(), ResourceShortage("no memory"), OSError(28, "full")]
)
def test_an_interrupt_and_a_machine_that_is_full_are_no_failures_of_a_package(error: BaseException) -> None:
    for door, name in ((OPERATOR_DOOR, "boom"), (EXPORT_DOOR, "tally")):
        with pytest.raises(type(error)) as caught, door.blaming_package(name):
            raise error
        assert caught.value is error
