"""A name that is not a constant of the code is joined to a path only by `path_below`, which checks it.

Names in the files of a run folder or a library, such as ids, golden runs, files of the ledger and scenarios,
come from whoever made the folder: `../../setup.py` must not reach a user's file. A reader of the code cannot
see where each name comes from, so every join in the packages that handle run folders and libraries follows
the rule.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
PACKAGES = (
    *(
        "store",
        "outcomes",
        "results",
        "preflight",
        "audit",
        "checks",
        "execution",
        "exports",
        "comparison",
        "report",
        "api",
    ),
    *("targets", "faults", "stpa", "mutants", "operators", "onboarding", "campaigns", "review"),
)
ALLOWED = {  # joins of names that no file contains
    "campaigns/git_clone.py: folder / objects": "printed by git, and only read",
    "campaigns/git_clone.py: folder / shallow": "printed by git, and only read",
    "campaigns/git_clone.py: folder / excluded": "printed by git, and only read",
    "campaigns/git_clone.py: folder / within": "names from os.scandir",
    "execution/cluster/piece_process.py: bundle.folder / f'work-{os.getpid()}'": "a process id",
    "execution/requested_campaigns.py: Path(config.invocation_params.dir, text.partition('::')[0])": (
        "what a user wrote in a command"
    ),
    "execution/requested_campaigns.py: root / value": "of the user's own pyproject.toml",
    "execution/xdist_controller.py: root / name": "of an item that pytest has collected",
    "faults/import_checks.py: root / path": "only shown",
    "mutants/parsed_files_and_anchors.py: root / path": "only shown",
    "mutants/modules_importing_constants.py: tree.root / path": "only shown",
    "onboarding/first_library.py: folder / form.format(name=variables['name'], entry=variables['entry'])": (
        "letters, digits and _"
    ),
    "onboarding/source_survey.py: Path(place, name)": "names from os.walk",
    "onboarding/source_survey.py: root / name": "names from a folder's listing",
    "operators/executed_lines_and_types.py: scratch / 'work' / f'lines-{i}'": "a number",
    "review/code_called_by_injections.py: folder / constant.value": "only compared with the tree's paths",
    "review/image_effect_pictures.py: scratch / 'work' / f'pictures-{i}'": "a number",
    "store/run_deletion.py: Path(folder, name)": "names from os.walk",
    "store/run_deletion.py: Path(name).with_name(final_name_of_half_written(Path(name).name))": (
        "only compared with patterns"
    ),
    "targets/source_tree.py: root / name": "the folder of a checked glob",
}


def constants(tree: ast.Module) -> set[str]:
    """Names that a loop or an assignment gives a constant of the code."""
    found: set[str] = set()
    for node in ast.walk(tree):
        match node:
            case ast.For(target=target, iter=values) | ast.comprehension(target=target, iter=values):
                if is_constant(values, found):
                    found |= {name.id for name in ast.walk(target) if isinstance(name, ast.Name)}
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if is_constant(value, found):
                found.add(name)
    return found


def is_constant(node: ast.expr, known: set[str]) -> bool:
    match node:
        case ast.Constant():
            return True
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name.isupper() or name in known
        case ast.Tuple(elts=parts) | ast.JoinedStr(values=parts):
            return all(is_constant(part, known) for part in parts)
        case ast.Starred(value=value) | ast.FormattedValue(value=value) | ast.Subscript(value=value):
            return is_constant(value, known)
        case ast.Call(func=ast.Attribute(value=value, attr="items"), args=[]):
            return is_constant(value, known)
    return False


def paths(trees: list[ast.Module]) -> set[str]:
    """Names of variables, attributes and functions that are annotated as paths somewhere, or joined."""
    found: set[str] = set()
    for node in (node for tree in trees for node in ast.walk(tree)):
        match node:
            case ast.arg(arg=name, annotation=kind) | ast.FunctionDef(name=name, returns=kind):
                annotation = kind
            case ast.AnnAssign(target=ast.Name(id=name), annotation=kind):
                annotation = kind
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.BinOp(op=ast.Div(), right=right)):
                annotation = ast.Name("Path") if isinstance(right, ast.Constant | ast.JoinedStr) else None
            case _:
                continue
        if annotation is not None and "Path" in ast.unparse(annotation):
            found.add(name)
    return found


def last_name(node: ast.expr) -> str:
    """The last name in an expression: `folder.path` is a `path`, `golden(one)` a `golden`."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case ast.Call(func=function):
            return last_name(function)
        case ast.BinOp(left=left, op=ast.Div()):
            return last_name(left)
        case ast.IfExp(body=body):
            return last_name(body)
    return ""


def joins(tree: ast.Module, known_paths: set[str]) -> Iterator[str]:
    """Yield every join of a path with something that is no constant."""
    known = constants(tree)
    for node in ast.walk(tree):
        match node:
            case ast.BinOp(left=left, op=ast.Div(), right=right) if last_name(left) in known_paths:
                parts = [right]
            case ast.Call(func=ast.Name(id="Path"), args=[_, *more]) if more:
                parts = more
            case ast.Call(func=ast.Attribute(attr="joinpath" | "with_name" | "with_stem"), args=more):
                parts = more
            case _:
                continue
        if not all(is_constant(part, known) for part in parts):
            yield ast.unparse(node)


def unchecked(root: Path) -> list[str]:
    files = [path for package in PACKAGES for path in sorted((root / "mutator" / package).rglob("*.py"))]
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in files}
    known = paths([*trees.values()])
    found = []
    for path, tree in trees.items():
        name = path.relative_to(root / "mutator").as_posix()
        found += [f"{name}: {join}" for join in joins(tree, known)]
    return found


def test_names_from_files_are_checked_where_they_are_joined() -> None:
    assert [one for one in unchecked(CLONE) if one not in ALLOWED] == []


def test_every_exception_is_needed() -> None:
    assert ALLOWED.keys() - {*unchecked(CLONE)} == set()


MODULE = """
NAMES = ("a", "b")
def golden(self, one: str) -> Path: ...
def reach(folder: RunFolder, run: Path, name: str, path: Path) -> None:
    {line}
"""


def planted(place: Path, line: str) -> list[str]:
    module = place / "mutator" / "store" / "new.py"
    module.parent.mkdir(parents=True)
    module.write_text(MODULE.format(line=line))
    return unchecked(place)


@pytest.mark.parametrize(
    "line",
    [
        "(run / name).unlink()",
        "shutil.copy(folder.path / name, folder.path / 'x')",
        "(folder.golden(one) / f'{name}.npz').read_bytes()",
        "open(run / 'records' / name)",
        "place = run / 'golden'; (place / name).mkdir()",
        "Path(run, name).write_bytes(b'')",
        "run.joinpath('plots', name).unlink()",
        "(run / 'x').with_name(name).unlink()",
        "[(run / one).unlink() for one in names]",
    ],
)
def test_a_join_that_bypasses_the_check_is_reported(tmp_path: Path, line: str) -> None:
    assert len(planted(tmp_path, line)) == 1


@pytest.mark.parametrize(
    "line",
    [
        "path_below(run, name).unlink()",
        "(run / 'records' / f'{NAMES}.csv').unlink()",
        "[(run / one).unlink() for one in NAMES]",
        "share = number / of",
    ],
)
def test_other_code_is_not_reported(tmp_path: Path, line: str) -> None:
    assert planted(tmp_path, line) == []
