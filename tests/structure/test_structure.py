"""The architecture: which package may import which, and what no module may do."""

import ast
import shutil
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from inspect import signature
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from mutator.cli.app import app
from mutator.cli.review_options import MutantOptions
from mutator.cli.shared_options import WorkspaceOptions

CLONE = Path(__file__).parents[2]
TOP_MODULES = 12
# may import the harness inside functions, to load only what a command or call needs: a finished run needs
# no pytest, a list no parser of Python
LAZY = (
    "mutator/__init__.py",
    "mutator/api/",
    "mutator/cli/",
    "mutator/execution/local_distributor.py",
    "mutator/execution/pytest_plugin.py",
    "mutator/workspace.py",
)


def modules(root: Path) -> Iterator[Path]:
    yield from sorted((root / "mutator").rglob("*.py"))


def imports(path: Path, root: Path) -> Iterator[tuple[str, bool]]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    inside = {node for function in functions for node in ast.walk(function)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node in inside
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if source(whole, root) else node.module, node in inside


def source(name: str, root: Path) -> Path | None:
    base = root / name.replace(".", "/")
    return next((p for p in (base.with_suffix(".py"), base / "__init__.py") if p.is_file()), None)


def top_modules(root: Path) -> list[str]:
    return sorted(path.name for path in (root / "mutator").glob("*.py"))


def hidden_imports(root: Path) -> list[str]:
    return [
        f"{path.relative_to(root)}: {name}"
        for path in modules(root)
        for name, inside in imports(path, root)
        if inside
        and name.partition(".")[0] == "mutator"
        and not path.relative_to(root).as_posix().startswith(LAZY)
    ]


def cycle(root: Path) -> list[str]:
    edges: dict[str, set[str]] = {str(path.relative_to(root)): set() for path in modules(root)}
    for path in modules(root):
        for name, _ in imports(path, root):
            if name.startswith("mutator.") and (found := source(name, root)):
                edges[str(path.relative_to(root))].add(str(found.relative_to(root)))
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def strangers_in_target(root: Path) -> list[str]:
    """Return imports of anything except the standard library and numpy in code that runs inside a target's
    process."""
    allowed = {*sys.stdlib_module_names, "numpy"}
    package = root / "mutator"
    return [
        f"{path.name}: {name}"
        for path in (package / "glue.py", *(package / "engines" / "in_target").glob("*.py"))
        for name, _ in imports(path, root)
        if name.partition(".")[0] not in allowed
    ]


def namesakes(root: Path) -> list[str]:
    return [
        str(path.relative_to(root))
        for path in modules(root)
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == path.stem
    ]


def lint(root: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as lint; lint()"]
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": f"{root}:{root / 'target'}", "COLUMNS": "200"}
    return subprocess.run(
        [*command, "--no-cache"], cwd=root, env=environment, capture_output=True, text=True, check=False
    )


def is_clean(root: Path) -> bool:
    found = (hidden_imports(root), cycle(root), strangers_in_target(root), namesakes(root))
    return not any(found) and len(top_modules(root)) <= TOP_MODULES and lint(root).returncode == 0


def test_packages_import_in_one_direction() -> None:
    done = lint(CLONE)
    assert done.returncode == 0, done.stdout + done.stderr


def test_modules_have_no_import_cycles_or_hidden_imports() -> None:
    top, hidden, circle = top_modules(CLONE), hidden_imports(CLONE), cycle(CLONE)
    print(
        f"modules at the top: {len(top)}, cycles: {bool(circle):d}, imports inside functions: {len(hidden)}"
    )
    assert len(top) <= TOP_MODULES, top
    assert not hidden
    assert not circle


def test_the_suite_runs_the_harness_as_it_is_installed() -> None:
    """pytest rewrites assertions of test modules only, because compiling the harness anew costs a second."""
    assert "Rewriting" not in type(sys.modules["mutator.model"].__loader__).__name__
    assert "Rewriting" in type(sys.modules[__name__].__loader__).__name__


def test_code_inside_a_target_imports_only_numpy_and_the_standard_library() -> None:
    assert not strangers_in_target(CLONE)


def test_no_function_has_its_modules_name() -> None:
    assert not namesakes(CLONE)


def test_every_package_has_a_long_docstring() -> None:
    for path in (CLONE / "mutator").rglob("__init__.py"):
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
        assert text and len(text) > 60, path


VIOLATIONS = {
    "direction": ("mutator/faults/fault_specs.py", "from mutator.campaigns import plan"),
    "direction, in a function": (
        "mutator/faults/fault_specs.py",
        "def f():\n    from mutator.campaigns import plan",
    ),
    "cycle": ("mutator/mutants/patch_rendering.py", "from mutator.mutants import mutant_building"),
    "cycle of types": (
        "mutator/mutants/patch_rendering.py",
        "import typing\nif typing.TYPE_CHECKING:\n    from mutator.mutants import mutant_building",
    ),
    "direction in the target": (
        "target/selfdrive/controls/controlsd.py",
        "from selfdrive.car.honda import values",
    ),
    "direction in the target, in a function": (
        "target/selfdrive/visiond/hog.py",
        "def f():\n    from selfdrive.sim import road_look",
    ),
    "cycle in the target": (
        "target/selfdrive/sim/picture_options.py",
        "def f():\n    from selfdrive.sim import camera_and_detector",
    ),
    "new package in the target": ("target/selfdrive/novel.py", "X = 1"),
    "target": ("mutator/engines/reference_engine.py", "import selfdrive.sim.run"),
    "harness": ("target/selfdrive/sim/run.py", "import mutator.errors"),
    "study": ("mutator/report/report_builder.py", "from mutator import paper"),
    "new package": ("mutator/novel.py", "X = 1"),
    "stranger in a target's process": ("mutator/engines/in_target/run_once.py", "import pandas"),
    "stranger in the glue": ("mutator/glue.py", "import yaml"),
    "harness in the glue": ("mutator/glue.py", "from mutator.errors import MutatorError"),
    "glue in the harness": ("mutator/engines/engine_jobs.py", "from mutator import glue"),
    "hidden import": (
        "mutator/report/experiment_filming.py",
        "def f():\n    from mutator.report import panel",
    ),
    "namesake": ("mutator/report/experiment_filming.py", "def film():\n    pass"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", VIOLATIONS)
def test_a_violation_fails_the_lint(name: str, tmp_path: Path) -> None:
    ignored = shutil.ignore_patterns("__pycache__", "*.npz")
    for folder in ("mutator", "target"):
        shutil.copytree(CLONE / folder, tmp_path / folder, ignore=ignored)
    shutil.copy(CLONE / "pyproject.toml", tmp_path)
    assert is_clean(tmp_path)
    file, line = VIOLATIONS[name]
    with (tmp_path / file).open("a", encoding="utf-8") as module:
        module.write(f"\n{line}\n")
    assert not is_clean(tmp_path)


# modules that the command line may import for options, help texts and presentation
SHOWN_BY_THE_COMMAND_LINE = {
    "mutator.comparison.gate_failures",
    "mutator.config.yaml_files",
    "mutator.engines.engine_kinds",
    "mutator.execution.progress_text",
    "mutator.explore.envelope_texts",
    "mutator.exports",
    "mutator.mutants.patches_by_file",
    "mutator.results.plan_columns",
    "mutator.review.group_filter_columns",
    "mutator.review.group_display_texts",
    "mutator.targets.manifests_by_name",
}


def test_the_command_line_calls_the_api() -> None:
    own = ("mutator.api.", "mutator.cli", "mutator._common", "mutator.errors")
    for path in (CLONE / "mutator" / "cli").glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        types = {
            node
            for block in ast.walk(tree)
            if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
            for node in ast.walk(block)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module and node not in types:
                inside = node.module.startswith("mutator.") and not node.module.startswith(own)
                assert not inside or node.module in SHOWN_BY_THE_COMMAND_LINE, f"{path}: {node.module}"


def test_options_of_every_review_verb_are_declared_once() -> None:
    """A set of options that several subcommands share is one dataclass, not parameters of each."""
    shared = {*signature(MutantOptions).parameters, *signature(WorkspaceOptions).parameters}
    functions = [
        node
        for name in ("review_command", "review_decision_commands")
        for node in ast.walk(ast.parse((CLONE / f"mutator/cli/{name}.py").read_bytes()))
        if isinstance(node, ast.FunctionDef)
    ]
    repeated = [
        f"{function.name}: {one.arg}"
        for function in functions
        for one in (*function.args.args, *function.args.kwonlyargs)
        if function.args.kwonlyargs and one.arg in shared  # a verb, whose WorkspaceOptions are a keyword
    ]
    assert repeated == []
    command: Any = get_command(app)
    verbs = command.commands["review"].commands.values()
    assert [verb.name for verb in verbs if not shared <= {one.name for one in verb.params}] == []
