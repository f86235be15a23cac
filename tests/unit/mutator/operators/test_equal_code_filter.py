"""Mutations to equal code are found in parts of functions, with the same result as in whole functions."""

import shutil
import sysconfig
from collections import defaultdict
from collections.abc import Hashable
from pathlib import Path

import pytest

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator.engines.code_swap_planning import behaviour_key
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parsed_file
from mutator.mutants.standalone_function_compilation import compile_standalone
from mutator.operators import equal_code_filter
from mutator.operators.equal_code_filter import drop_equal_code, mutated_function_lines
from mutator.operators.mutation_listing import mutations_of
from mutator.operators.mutations import Mutation
from mutator.operators.statement_facts import statement_facts_of
from mutator.targets.source_tree import read_tree
from mutator.workspace import Workspace

STANDARD_LIBRARY = Path(sysconfig.get_path("stdlib"))
SOURCES = {
    "folded": """\
def f(a):
    x = 2 * 3 + a
    return (1, 2) + (2, 1), -(-a), not not a, 0 * 1
""",
    "never reached": """\
def f(a):
    return 1
    a = 1
    g(a, 2)
    if a > 1:
        return 1
""",
    "decided in advance": """\
def f(a):
    while True:
        a += 1 if True else 2
        if 0:
            a = 5
        if __debug__ and a > 3:
            break
    assert 1, a
    return 1 or a
""",
    "dropped names": """\
def f(a):
    b = g(a)
    b = False
    return b if a else None
""",
    "dropped constants": """\
def f(a):
    b = a if a > 2 else a
    c = [3 for d in b if d]
    return True, c, 7
""",
    "equal statements": """\
def f(a):
    g(a)
    g(a)
    g(a)
    a = 1
    a = 1
    return a
""",
    "sets": """\
def f(a):
    return a in {1, 2, 3}, {(1, 2), (2, 1)}, a in [1, 2], {0: 1, 1: 0}
""",
    "scopes": """\
def f(a):
    n = 1
    n = 2
    def g():
        nonlocal n
        n = 3
        return n + 1
    global m
    m = a
    class C:
        def __h(self):
            return self.__h() + 1
    return g, C
""",
    "generators": """\
async def f(a):
    async for b in a(1):
        await b(c=2)
        yield b + 1
def g():
    x = yield 1
    yield from h(x, 2)
    return [i for i in x]
""",
    "match": """\
def f(a):
    match a + 1:
        case [1, b] if b > 2:
            return b + 1
    return 0
""",
    "blocks": """\
def f(a):
    try:
        with a(1) as b, a(2):
            for c in range(3): a = c + 1
            else:
                a = 2
    except E:
        raise E(1) from None
    finally:
        g(3)
    if a == 1: return 1
    elif a == 2:
        return 2
    while a < 3:
        a += 1
    x: int = 1; y = 2
""",
    "lines": """\
def f(a):
    return (a
            if a > 1 else
            (1
             + 2))
""",
    "long": f"""\
def f(a):
    return [{", ".join(f"{i % 5}, -{i}, a * {i}, ({i}, 1)" for i in range(8))}]
def g(a):
    return a.b({", ".join(f"{i} + {i}" for i in range(12))}, *a, c=1, d=2)
def h(a):
    return {{{", ".join(f"{i}: {i % 3}" for i in range(12))}}}, a in ({", ".join("1" * 12)})
""",
}


def decisions(file: ParsedFile, mutations: list[Mutation]) -> list[Mutation]:
    """Return the mutations that stay if each function is compiled anew with each mutation."""
    codes: dict[range, set[Hashable]] = defaultdict(set)
    distinct = []
    for mutation in mutations:
        function = file.outermost_function_at(mutation.line)
        assert function is not None
        lines = [
            [*file.lines[function.start : function.stop]],
            mutated_function_lines(file, function, mutation),
        ]
        original, code = (compile_standalone(text, file.encoding) for text in lines)
        assert original is not None
        if not codes[function]:
            codes[function].add(behaviour_key(original))
        if code is not None and behaviour_key(code) not in codes[function]:
            codes[function].add(behaviour_key(code))
            distinct.append(mutation)
    return distinct


def mutations_in(folder: Path, name: str, models: FaultModels) -> tuple[ParsedFile, list[Mutation]]:
    tree = read_tree(folder, [name])
    file, facts = parsed_file(tree, name), statement_facts_of(tree, name)
    functions, operators = file.functions_by_name, OPERATOR_DOOR.shipped_names()
    return file, [
        one for function in functions for one in mutations_of(file, facts, function, models, operators)
    ]


@pytest.mark.parametrize("name", SOURCES)
def test_the_same_mutations_stay_as_if_whole_functions_were_compiled(
    name: str, tmp_path: Path, clone: Workspace
) -> None:
    (tmp_path / "m.py").write_text(SOURCES[name])
    file, mutations = mutations_in(tmp_path, "m.py", clone.fault_models())
    assert mutations
    assert list(drop_equal_code(file, mutations).mutations) == decisions(file, mutations)


@pytest.mark.parametrize("name", ["colorsys", "bisect", "fnmatch"])
def test_the_same_mutations_stay_in_modules_of_the_standard_library(
    name: str, tmp_path: Path, clone: Workspace
) -> None:
    shutil.copy(STANDARD_LIBRARY / f"{name}.py", tmp_path)
    file, mutations = mutations_in(tmp_path, f"{name}.py", clone.fault_models())
    assert list(drop_equal_code(file, mutations).mutations) == decisions(file, mutations)


@pytest.mark.slow
@pytest.mark.parametrize("letter", "abcdefghijklmnopqrstuvwxyz")
def test_the_same_mutations_stay_in_the_whole_standard_library(
    letter: str, tmp_path: Path, clone: Workspace
) -> None:
    models = clone.fault_models()
    for path in sorted(STANDARD_LIBRARY.glob(f"{letter}*.py")):
        shutil.copy(path, tmp_path)
        try:
            file, mutations = mutations_in(tmp_path, path.name, models)
        except MutatorError:
            continue  # LibCST cannot read it
        assert list(drop_equal_code(file, mutations).mutations) == decisions(file, mutations), path


@pytest.mark.parametrize(
    "body",
    [
        f"return [{', '.join(f'{i}.5' for i in range(60))}]",
        "\n    ".join(f"a.b{i} = g(a, {i}.5, c={i})" for i in range(25)),
        "\n    ".join(f"{'el' * (i > 0)}if a == {i}:\n        g({i})" for i in range(25)),
        f"return dict({', '.join(f'k{i}=({i}, {i}.5, [a])' for i in range(25))})",
    ],
)
def test_a_long_function_is_never_compiled_whole(
    body: str, tmp_path: Path, clone: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise, the time to find mutations would grow with the square of the function's length."""
    (tmp_path / "m.py").write_text(f"def f(a):\n    {body}\n")
    file, mutations = mutations_in(tmp_path, "m.py", clone.fault_models())
    expected = decisions(file, mutations)
    monkeypatch.setattr(equal_code_filter, "compile_standalone", lambda *_: pytest.fail("compiled whole"))
    assert list(drop_equal_code(file, mutations).mutations) == expected
