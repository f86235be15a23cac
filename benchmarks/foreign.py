"""Mutate other people's code: `python benchmarks/foreign.py FOLDER...`.

In every Python file below the folders, the benchmark lists the places and finds the mutations. It makes one
mutant of each operator and of some kinds of place, with the probe's import. Each must compile, un-splice to
the file's bytes, and have the original's syntax tree once everything that asks the probe is taken out. A file
that Python or LibCST cannot parse is refused, with a reason. Goals: no traceback, no wrong mutant, and 0.5 ms
of CPU to find a mutation in a parsed file.
"""

import argparse
import ast
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from time import process_time

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator.config.location_syntax import PROBE_MODULE_NAME
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.model import AnchorKind, Injection
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parsed_file
from mutator.mutants.possible_places import ListedPlace, places_of
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, probe_import_edit, unsplice
from mutator.operators.equal_code_filter import drop_equal_code
from mutator.operators.mutation_listing import mutations_of
from mutator.operators.mutations import Mutation
from mutator.operators.statement_facts import statement_facts_of
from mutator.targets.source_tree import read_tree
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]
GOAL_MS = 0.5  # of CPU for a mutation
FEWEST_MUTATIONS = 20  # of a file that counts for the median
INJECTION_ID = "0a1b2c3d"
# a fault model for each kind of place
MODELS_BY_KIND = {
    AnchorKind.ENTRY: ("exception", {"error": "ValueError"}),
    AnchorKind.BEFORE_CALL: ("omission", {}),
    AnchorKind.BEFORE_ASSIGN: ("omission", {}),
}


@dataclass(slots=True)
class Figures:
    files: int = 0
    places: int = 0
    mutations: int = 0
    mutants: int = 0
    ms_by_file: dict[Path, float] = field(default_factory=dict)  # of finding a mutation
    finding_s: float = 0.0
    parsing_s: float = 0.0
    refused: Counter[str] = field(default_factory=Counter)
    refused_mutants: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    tracebacks: list[str] = field(default_factory=list)


class InactiveCode(ast.NodeTransformer):
    """Takes out what a mutant adds: the probe's import and all that asks the probe first."""

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        return self.generic_visit(node) if not _asks_probe(node.test) else self.visit(node.orelse)

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.AST]:
        self.generic_visit(node)
        if not _asks_probe(node.test):
            return node
        is_guard = isinstance(node.test, ast.UnaryOp)
        return [*(node.body if is_guard else node.orelse)]

    def visit_Import(self, node: ast.Import) -> ast.AST | None:
        return None if [alias.name for alias in node.names] == [PROBE_MODULE_NAME] else node


def _asks_probe(test: ast.expr) -> bool:
    test = test.operand if isinstance(test, ast.UnaryOp) else test
    return ast.unparse(test).startswith(f"{PROBE_MODULE_NAME}.")


def injections_in(mutations: list[Mutation], places: list[ListedPlace]) -> Iterator[tuple[str, Injection]]:
    """Yield the middle mutation of each operator, and an injection at the middle place of some kinds."""
    for operator in dict.fromkeys(mutation.operator for mutation in mutations):
        of_operator = [mutation for mutation in mutations if mutation.operator == operator]
        yield operator, of_operator[len(of_operator) // 2].to_fault("").injections[0]
    for kind, (model, params) in MODELS_BY_KIND.items():
        alike = [one for one in places if one.location.anchor.kind is kind and model in one.models]
        if alike:
            location = alike[len(alike) // 2].location
            yield kind.value, Injection(location=location, model=model, params=tuple(sorted(params.items())))


def check_mutant(file: ParsedFile, models: FaultModels, injection: Injection) -> str | None:
    """Make the mutant of an injection; return what is wrong with it. MutatorError if it is refused."""
    edit = injection_edit(file, models, injection, INJECTION_ID)
    pieces = apply_edits(file, as_line_edits(file, [probe_import_edit(file, None), edit]))
    mutant = mutated_bytes(pieces)
    try:
        tree = ast.parse(mutant)
        compile(mutant, file.path, "exec", dont_inherit=True)
    except SyntaxError as error:
        return f"does not compile: {error}"
    if unsplice(mutant) != file.data:
        return "does not un-splice"
    if ast.dump(InactiveCode().visit(tree)) != ast.dump(file.syntax_tree):
        return "its inactive code differs"
    return None


def try_file(path: Path, models: FaultModels, figures: Figures) -> None:
    start = process_time()
    tree = read_tree(path.parent, [path.name])
    file, facts = parsed_file(tree, path.name), statement_facts_of(tree, path.name)
    parsed = process_time()
    operators = OPERATOR_DOOR.shipped_names()
    functions = file.functions_by_name
    listed = [one for name in functions for one in mutations_of(file, facts, name, models, operators)]
    mutations = [*drop_equal_code(file, listed).mutations]
    seconds = process_time() - parsed
    figures.mutations += len(listed)
    figures.finding_s += seconds
    figures.parsing_s += parsed - start
    if len(listed) >= FEWEST_MUTATIONS:
        figures.ms_by_file[path] = 1000 * seconds / len(listed)
    places = places_of(file, models)
    figures.places += len(places)
    for kind, injection in injections_in(mutations, places):
        try:
            problem = check_mutant(file, models, injection)
        except MutatorError as error:
            figures.refused_mutants[f"{kind}: {error.got}"] += 1
            continue
        figures.mutants += 1
        if problem:
            figures.wrong.append(f"{path}: {kind} at {injection.location}: {problem}")


def python_files(folders: list[Path]) -> Iterator[Path]:
    for folder in folders:
        # a link's file is tried where it is
        yield from sorted(path for path in folder.rglob("*.py") if path.is_file() and not path.is_symlink())


def print_figures(figures: Figures) -> None:
    print(f"{figures.files} files, {figures.places} places")
    print(f"{figures.mutations} mutations, {figures.mutants} mutants made")
    print(f"{figures.refused.total()} files refused")
    for reason, count in figures.refused.most_common():
        print(f"{count:6}  {reason}")
    print(f"{figures.refused_mutants.total()} mutants refused")
    for reason, count in figures.refused_mutants.most_common(20):
        print(f"{count:6}  {reason}")
    print(f"{len(figures.tracebacks)} tracebacks", *figures.tracebacks, sep="\n")
    print(f"{len(figures.wrong)} wrong mutants", *figures.wrong, sep="\n")
    if figures.ms_by_file:
        slowest = max(figures.ms_by_file, key=figures.ms_by_file.__getitem__)
        print(
            f"{finding_ms(figures):.2f} ms of CPU to find a mutation, goal {GOAL_MS} ms; by file: median "
            f"{median(figures.ms_by_file.values()):.2f} ms, at most {figures.ms_by_file[slowest]:.2f} ms "
            f"({slowest})"
        )
    print(f"{1000 * figures.parsing_s / max(1, figures.files):.0f} ms of CPU to parse a file")


def finding_ms(figures: Figures) -> float:
    return 1000 * figures.finding_s / max(1, figures.mutations)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0] + ".")
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--part", default="1/1", help="take only every n-th file: PART/PARTS, such as 2/8")
    options = parser.parse_args()
    number, count = map(int, options.part.split("/"))
    models, figures = Workspace.find(root=ROOT).fault_models(), Figures()
    warnings.simplefilter("ignore")  # of the files that are parsed
    for path in [*python_files(options.folders)][number - 1 :: count]:
        figures.files += 1
        try:
            try_file(path, models, figures)
        except MutatorError as error:
            figures.refused[error.got] += 1
        except Exception:
            figures.tracebacks.append(f"{path}\n{traceback.format_exc()}")
    print_figures(figures)
    return 1 if figures.tracebacks or figures.wrong or finding_ms(figures) > GOAL_MS else 0


if __name__ == "__main__":
    sys.exit(main())
