"""Mutation operators: the mutations of small sources, the exclusions, and samples."""

import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator.errors import MutatorError
from mutator.mutants.mutant_building import build, build_without_reusing_changed_files
from mutator.mutants.parsed_files_and_anchors import parsed_file
from mutator.operators.equal_code_filter import drop_equal_code
from mutator.operators.mutation_listing import mutations_of
from mutator.operators.mutation_selection import SelectedMutations, sample_mutations, select_mutations
from mutator.operators.mutations import Mutation
from mutator.operators.operator_lookup import find_operator, unique_operator_names
from mutator.operators.statement_facts import statement_facts_of
from mutator.targets.source_tree import read_tree
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

Make = Callable[..., list[Mutation]]


@pytest.fixture
def make(tmp_path: Path, clone: Workspace) -> Make:
    """Return the mutations of a function `f` with the given body, by the given operators or by all."""
    models = clone.fault_models()

    def made(body: str, *operators: str, head: str = "def f(self, a, b):") -> list[Mutation]:
        (tmp_path / "m.py").write_text(f"{head}\n    {body}\n")
        tree = read_tree(tmp_path, ["m.py"])
        file, names = parsed_file(tree, "m.py"), unique_operator_names(operators or OPERATOR_DOOR.names())
        return list(
            drop_equal_code(
                file, mutations_of(file, statement_facts_of(tree, "m.py"), "f", models, names)
            ).mutations
        )

    return made


@pytest.mark.parametrize("name", OPERATOR_DOOR.names())
def test_each_operator_makes_the_changes_of_its_examples(name: str, make: Make) -> None:
    examples = find_operator(name).examples
    assert any(examples.values())
    for body, expected in examples.items():
        assert [one.description for one in make(body, name)] == list(expected), body


def test_an_operator_of_another_package_is_used_like_the_others(
    door_examples: Path, make: Make, toycar: Workspace
) -> None:
    test_each_operator_makes_the_changes_of_its_examples("zero", make)
    both = make("return a(b, c)", "zero", "return")  # `return 0` is one change, made by the shipped one
    assert [one.operator for one in both] == ["return"] * 3
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()
    found = select_mutations(manifest, models, ["zero"], ["toycar/**"])
    fault = found.mutations[0].to_fault("as_described")
    assert fault.spec.startswith("operators/zero/") and str(fault.value).endswith(" -> 0")
    assert build(manifest, models, fault, always_trigger()).patch


def test_an_expression_with_a_yield_has_no_mutations(make: Make) -> None:
    assert not make("return (yield a) + b", "arithmetic", "return")


def test_mutations_to_equal_code_are_dropped(make: Make) -> None:
    assert [one.description for one in make("while True: a()", "branch")] == ["True -> not True"]
    denied = make("return not a", "comparison", "return")
    assert [(one.operator, one.source_after) for one in denied] == [
        ("comparison", "not (not a)"),
        ("return", "None"),
    ]


def test_first_assignments_are_never_omitted_in_functions_with_the_same_name(make: Make) -> None:
    """A property and its setter have the same name."""
    setter = "@f.setter\n    def f(self, a):\n        c = a\n        self.a = c"
    made = make(
        f"@property\n    def f(self):\n        c = 1\n        return c\n    {setter}",
        "omission",
        head="if 1:",
    )
    assert [one.description for one in made] == ["self.a = c -> left out"]


ANNOTATED = """{before}
    def g(k{kind} = b + 1){result}:
        if k > b: return k
        return -k
    c{kind} = a + 1
    self.c{kind} = g(c)
    return c - 1"""


@pytest.mark.parametrize(
    "kind", ["later", "1 / 0", "a(1) + b > 3", "[x + 1 for x in a]", "lambda q=1: q + 1"]
)
def test_annotations_have_no_mutations(make: Make, kind: str) -> None:
    """Since Python 3.14, they need not even run."""
    plain = make(ANNOTATED.format(before="pass", kind="", result=""))
    annotated = make(
        ANNOTATED.format(before=f"c: {kind}", kind=f": {kind}", result=f" -> {kind}"),
        head=f"def f(self, a: {kind}, b: {kind}) -> {kind}:",
    )
    assert len(plain) > 10
    assert [(one.line, one.description.replace(f": {kind} =", " =")) for one in annotated] == [
        (one.line, one.description) for one in plain
    ]


@pytest.mark.skipif(sys.version_info < (3, 14), reason="t-strings need Python 3.14")
def test_a_t_string_has_the_mutations_of_an_f_string(make: Make) -> None:
    body = "c = a({0}'{{a + 1}}', b) + {0}'{{b > 1}}'\n    self.c = {0}'{{a}}'\n    return {0}'{{a - 1}}'"
    of_f, of_t = make(body.format("f")), make(body.format("t"))
    assert of_f and [one.description.replace("t'", "f'") for one in of_t] == [one.description for one in of_f]


def test_mutants_of_a_file_with_a_byte_order_mark_compile(tmp_path: Path, clone: Workspace) -> None:
    (tmp_path / "m.py").write_bytes("\ufeffdef f(a):\n    return a + 1\n".encode())
    tree = read_tree(tmp_path, ["m.py"])
    file, models = parsed_file(tree, "m.py"), clone.fault_models()
    made = mutations_of(file, statement_facts_of(tree, "m.py"), "f", models, ["arithmetic"])
    assert made and not drop_equal_code(file, made).invalid_count


def test_a_long_change_is_shortened_to_the_part_that_differs(make: Make) -> None:
    [long] = make(f"{'a' * 80}(b, limit=a)", "argument")
    assert long.description == ".. aaaaaaaaaaaaaaaaaa(b, limit=a) -> .. aaaaaaaaaaaaaaaaaa(b)"


def test_places_can_be_files_functions_and_globs(toycar: Workspace) -> None:
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()

    def found(place: str, executed: dict[str, list[int]] | None = None) -> SelectedMutations:
        return select_mutations(manifest, models, OPERATOR_DOOR.shipped_names(), [place], executed)

    whole, part = found("toycar/sensing.py"), found("toycar/sensing.py::Sensor.*")
    assert part.mutations and set(part.mutations) <= set(whole.mutations)
    assert set(whole.mutations) <= set(found("toycar/**").mutations)
    line = part.mutations[0].line + 1
    some = found("toycar/sensing.py", {"toycar/sensing.py": [line]})
    assert {one.line + 1 for one in some.mutations} == {line} and some.unexecuted_count
    assert f"{some.unexecuted_count} in lines that no golden run executes" in some.summary
    for place, text in {
        "toycar/sensin.py": "no Python file",
        "toycar/sensing.py::G": "no function 'G'",
    }.items():
        with pytest.raises(MutatorError, match=text):
            found(place)
    with pytest.raises(MutatorError, match="no operator 'arith'"):
        unique_operator_names(["arith"])


def test_a_file_that_cannot_be_changed_costs_only_its_own_mutants(toycar: Workspace) -> None:
    folder, models = toycar.library.parent / "tree/toycar/odd", toycar.fault_models()
    folder.mkdir()
    for name, source in {
        "a.py": "def f(a):\n    return a + 1\n",
        "b.py": "def f(a):\n    x = a\n    return(lambda: a + 1)()\n",
        "c.py": "def f(a):\n    (b): int = a\n    return b + 1\n",
        "d.py": "print 'Python 2'\n",
    }.items():
        (folder / name).write_text(source)
    manifest, odd = toycar.manifest("toycar"), "toycar/odd"
    both = select_mutations(manifest, models, ["arithmetic"], [f"{odd}/*.py", f"{odd}/*.py::f"])
    alone = select_mutations(manifest, models, ["arithmetic"], [f"{odd}/a.py"])
    assert both.mutations == alone.mutations and not alone.refused_files
    places = [text.partition(": ")[0] for text in both.refused_files]
    assert places == [f"{odd}/b.py:3", f"{odd}/c.py:2", f"{odd}/d.py:1"]
    assert f"all in 3 files that cannot be changed ({odd}/b.py:3: LibCST cannot parse" in both.summary
    for place in (f"{odd}/b.py", f"{odd}/b*.py::f"):
        with pytest.raises(MutatorError, match=r"b\.py:3: .*right after a keyword"):
            select_mutations(manifest, models, ["arithmetic"], [place])


def test_text_that_the_encoding_of_the_file_lacks_is_no_mutation(tmp_path: Path, clone: Workspace) -> None:
    source = "# coding: latin-1\ndef f(a):\n    return a('\\u20ac', 1), '\xe9'\n"
    (tmp_path / "m.py").write_bytes(source.encode("latin-1"))
    tree = read_tree(tmp_path, ["m.py"])
    file, facts = parsed_file(tree, "m.py"), statement_facts_of(tree, "m.py")
    mutations = mutations_of(file, facts, "f", clone.fault_models(), OPERATOR_DOOR.shipped_names())
    assert {one.operator for one in mutations} == {"constant", "return"}
    assert drop_equal_code(file, mutations).mutations == tuple(mutations)


def test_samples_are_stratified_and_reproducible(toycar: Workspace) -> None:
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()
    found = select_mutations(manifest, models, OPERATOR_DOOR.shipped_names(), ["toycar/**"])
    drawn = sample_mutations(found, len(found.mutations) // 3, 4)
    assert (
        drawn
        == sample_mutations(found, len(found.mutations) // 3, 4)
        != sample_mutations(found, len(drawn), 5)
    )
    spec = Counter(one.to_fault("r").spec for one in found.mutations)
    taken = Counter(one.to_fault("r").spec for one in drawn)
    assert len(drawn) == len(found.mutations) // 3
    assert all(abs(taken[name] - count / 3) < 1.4 for name, count in spec.items())


def test_every_mutant_of_the_toy_can_be_built(toycar: Workspace) -> None:
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()
    found = select_mutations(
        manifest, models, OPERATOR_DOOR.shipped_names(), ["toycar/sensing.py", "toycar/driver.py"]
    )
    faults = [one.to_fault("as_described") for one in found.mutations]
    assert len({fault.id for fault in faults}) == len(faults)
    for fault in faults:
        mutant = build(manifest, models, fault, always_trigger())
        assert mutant == build_without_reusing_changed_files(manifest, models, fault, always_trigger())
