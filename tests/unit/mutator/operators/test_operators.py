"""Mutation operators: the mutations of small sources, the exclusions, and samples."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.mutants.anchors import parsed
from mutator.mutants.building import build, build_directly
from mutator.operators.chosen import Found, find_mutations, sampled
from mutator.operators.enumeration import mutations_of
from mutator.operators.equal_code import distinct
from mutator.operators.facts import facts_of
from mutator.operators.mutations import Mutation
from mutator.operators.names import Operator, operators_named
from mutator.targets.source_tree import read_tree
from mutator.triggers.kinds import always
from mutator.workspace import Workspace

Make = Callable[..., list[Mutation]]
CHANGES = {
    "arithmetic": {
        "return a + b": ["a + b -> a - b", "a + b -> a * b", "a + b -> a / b"],
        "return a - b": ["a - b -> a + b", "a - b -> a * b", "a - b -> a / b"],
        "return a // b": ["a // b -> a / b", "a // b -> a * b"],
        "return a % b": ["a % b -> a // b", "a % b -> a * b"],
        "return a ** b": ["a ** b -> a * b", "a ** b -> a / b"],
        "return a << b": ["a << b -> a >> b"],
        "return a & b": ["a & b -> a | b", "a & b -> a ^ b"],
        "return -a": ["-a -> -(-a)"],
        "a += b": ["b -> -b"],
        "a *= b": ["b -> 1 / b"],
        "return 'a' + b": [],
        "return [a] + b": [],
        "a |= b": [],
    },
    "comparison": {
        "return a < b": [f"a < b -> a {to} b" for to in ("<=", ">", ">=", "==", "!=")],
        "return a == b": ["a == b -> a != b"],
        "return a is not b": ["a is not b -> a is b"],
        "return a not in b": ["a not in b -> a in b"],
        "return a and b": ["a and b -> a or b"],
        "return a or b or c": ["a or b or c -> (a or b) and c"],
        "return not a": ["not a -> not (not a)"],
        "return a < b < c": [],
    },
    "constant": {
        "return a[2]": ["2 -> 0", "2 -> 1", "2 -> -1", "2 -> 3", "2 -> -2"],
        "return 0": ["0 -> 1", "0 -> -1"],
        "return -0.5": ["-0.5 -> 0.0", "-0.5 -> 1.0", "-0.5 -> -1.0", "-0.5 -> 0.5", "-0.5 -> -1.5"],
        "return True": ["True -> False"],
        "return 'a'": [],
        "return None": [],
    },
    "branch": {
        "if a: return b": ["a -> not a", "a -> True", "a -> False"],
        "return b if a else c": ["a -> not a", "a -> True", "a -> False"],
        "return [b for b in c if a]": ["a -> not a", "a -> True", "a -> False"],
        "if (c := a) > b: return c": ["(c := a) > b -> not ((c := a) > b)"],  # a constant would not set `c`
        "return a": [],
    },
    "omission": {
        "a = b": ["a = b -> left out"],
        "self.a = b": ["self.a = b -> left out"],
        "a += b": ["a += b -> left out"],
        "a(b)": ["a(b) -> left out"],
        "c = b": [],  # the first value of `c`, without which the name would not exist
        "if a: b = c": [],
        "a([c for c in b])\n    c = b": [
            "a([c for c in b]) -> left out"
        ],  # the `c` inside is a different variable
    },
    "return": {
        "return a": ["a -> None", "a -> 0", "a -> -a"],
        "return a < b": ["a < b -> None", "a < b -> not (a < b)"],
        "return [a]": ["[a] -> None", "[a] -> []"],
        "return a, b": ["(a, b) -> None", "(a, b) -> ()"],
        "return {}": ["{} -> None"],
        "return 'a'": ["'a' -> None", "'a' -> ''"],
        "return 1": ["1 -> None"],
        "return -1": ["-1 -> None"],
        "return": [],
    },
    "argument": {
        "a(b, c)": ["a(b, c) -> a(c, b)"],
        "a(b, c=1, d=2)": ["a(b, c=1, d=2) -> a(b, d=2)", "a(b, c=1, d=2) -> a(b, c=1)"],
        "a(*b, c)": [],
        "a(b)": [],
    },
}


@pytest.fixture
def make(tmp_path: Path, clone: Workspace) -> Make:
    """Return the mutations of a function `f` with the given body, by the given operators or by all."""
    models = clone.fault_models()

    def made(body: str, *operators: str, head: str = "def f(self, a, b):") -> list[Mutation]:
        (tmp_path / "m.py").write_text(f"{head}\n    {body}\n")
        tree = read_tree(tmp_path, ["m.py"])
        file, names = parsed(tree, "m.py"), operators_named(operators or [one.value for one in Operator])
        return list(distinct(file, mutations_of(file, facts_of(tree, "m.py"), "f", models, names)).mutations)

    return made


@pytest.mark.parametrize("operator", CHANGES)
def test_each_operator_makes_the_expected_changes(operator: str, make: Make) -> None:
    for body, expected in CHANGES[operator].items():
        assert [one.text for one in make(body, operator)] == expected, body


def test_an_expression_with_a_yield_has_no_mutations(make: Make) -> None:
    assert not make("return (yield a) + b", "arithmetic", "return")


def test_mutations_to_equal_code_are_dropped(make: Make) -> None:
    assert [one.text for one in make("while True: a()", "branch")] == ["True -> not True"]
    denied = make("return not a", "comparison", "return")
    assert [(one.operator.value, one.now) for one in denied] == [
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
    assert [one.text for one in made] == ["self.a = c -> left out"]


def test_mutants_of_a_file_with_a_byte_order_mark_compile(tmp_path: Path, clone: Workspace) -> None:
    (tmp_path / "m.py").write_bytes("\ufeffdef f(a):\n    return a + 1\n".encode())
    tree = read_tree(tmp_path, ["m.py"])
    file, models = parsed(tree, "m.py"), clone.fault_models()
    made = mutations_of(file, facts_of(tree, "m.py"), "f", models, [Operator.ARITHMETIC])
    assert made and not distinct(file, made).invalid


def test_a_long_change_is_shortened_to_the_part_that_differs(make: Make) -> None:
    [long] = make(f"{'a' * 80}(b, limit=a)", "argument")
    assert long.text == ".. aaaaaaaaaaaaaaaaaa(b, limit=a) -> .. aaaaaaaaaaaaaaaaaa(b)"


def test_places_can_be_files_functions_and_globs(toycar: Workspace) -> None:
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()

    def found(place: str, executed: dict[str, list[int]] | None = None) -> Found:
        return find_mutations(manifest, models, list(Operator), [place], executed)

    whole, part = found("toycar/sensing.py"), found("toycar/sensing.py::Sensor.*")
    assert part.mutations and set(part.mutations) <= set(whole.mutations)
    assert set(whole.mutations) <= set(found("toycar/**").mutations)
    line = part.mutations[0].line + 1
    some = found("toycar/sensing.py", {"toycar/sensing.py": [line]})
    assert {one.line + 1 for one in some.mutations} == {line} and some.unexecuted
    assert f"{some.unexecuted} in lines that no golden run executes" in some.told
    for place, text in {
        "toycar/sensin.py": "no Python file",
        "toycar/sensing.py::G": "no function 'G'",
    }.items():
        with pytest.raises(MutatorError, match=text):
            found(place)
    with pytest.raises(MutatorError, match="no operator 'arith'"):
        operators_named(["arith"])


def test_samples_are_stratified_and_reproducible(toycar: Workspace) -> None:
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()
    found = find_mutations(manifest, models, list(Operator), ["toycar/**"])
    drawn = sampled(found, len(found.mutations) // 3, 4)
    assert drawn == sampled(found, len(found.mutations) // 3, 4) != sampled(found, len(drawn), 5)
    spec = Counter(one.fault("r").spec for one in found.mutations)
    taken = Counter(one.fault("r").spec for one in drawn)
    assert len(drawn) == len(found.mutations) // 3
    assert all(abs(taken[name] - count / 3) < 1.4 for name, count in spec.items())


def test_every_mutant_of_the_toy_can_be_built(toycar: Workspace) -> None:
    manifest, models = toycar.manifest("toycar"), toycar.fault_models()
    found = find_mutations(manifest, models, list(Operator), ["toycar/sensing.py", "toycar/driver.py"])
    faults = [one.fault("as_described") for one in found.mutations]
    assert len({fault.id for fault in faults}) == len(faults)
    for fault in faults:
        mutant = build(manifest, models, fault, always())
        assert mutant == build_directly(manifest, models, fault, always())
