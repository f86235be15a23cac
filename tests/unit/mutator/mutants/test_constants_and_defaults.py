"""Constants and defaults that faults change during a run."""

import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation, Hold, Injection, Trigger
from mutator.mutants import probe_contract as contract
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.modules_importing_constants import dotted_names_importing_constant
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, probe_import_edit, unsplice
from mutator.targets.observed_values import Observation
from mutator.targets.source_tree import read_tree
from mutator.workspace import Workspace

SOURCE = '''"""How it is tuned."""
import functools, types
from dataclasses import dataclass, field

import attrs
from enum import Enum

LIMIT = 5
if LIMIT > 3:
    LOW = 1
else:
    LOW = 2


class Gains:
    P = 1.0; I = 2.0

    @staticmethod
    def f(x=1, *, y=2):
        return x + y

    def g(self, z=9): return z

    @property
    def h(self):
        return self.P


@dataclass
class Field:
    a: float = 1.0
    b: list = field(default_factory=list)
    c: int = field(default=3, kw_only=True)


@dataclass(slots=True)
class Slotted(Field):
    d: int = 4


class Gear(Enum):
    DRIVE = 1


@attrs.define
class Defined:
    e: float = 1.0
    _f: int = attrs.field(default=2, kw_only=True)


@attrs.define
class Derived(Defined):
    g: float = 5.0


class Table(type):
    def __new__(kind, name, bases, names):
        names["_defaults"] = {key: names[key] for key in names.get("__annotations__", {})}
        return super().__new__(kind, name, bases, names)


class Tabled(metaclass=Table):
    h: float = 1.0

    def __init__(self, **values):
        vars(self).update({**self._defaults, **values})


def defaults(kind):
    kind._fields = {key: getattr(kind, key) for key in kind.__annotations__}
    kind.__init__ = lambda self: vars(self).update(self._fields)
    return kind


@defaults
class Decorated:
    k: float = 1.0


def copying(kind):
    values = {key: getattr(kind, key) for key in kind.__annotations__}
    first = next(iter(values.values()))

    @functools.wraps(kind.__init__)
    def init(self, **changes):
        vars(self).update({**values, **changes})
        self.first = first

    kind.__init__ = init
    return kind


@copying
class Closed:
    l: float = 1.0


def one_value(kind):
    m = kind.m
    kind.start = property(lambda self: m)
    return kind


@one_value
class Single:
    m: float = 1.0


ALL_DEFAULTS = {}


class Base:
    by_class = {}

    def __init_subclass__(cls):
        cls.defaults = {key: getattr(cls, key) for key in vars(cls) if not key.startswith("_")}
        ALL_DEFAULTS[cls.__name__] = dict(cls.defaults)
        Base.by_class[cls] = dict(cls.defaults)


class Listed(Base):
    n = 1.0


class Below(Listed):
    o = 1.0


class Beside(Base):
    n = 1.0


def generated(kind):
    names = {}
    exec(f"def init(self, p={kind.p}): self.p = p", names)
    names["init"].__defaults__ = (kind.p,)
    kind.__init__ = names["init"]
    return kind


@generated
class Generated:
    p: float = 1.0


def derived(kind):
    return type(kind.__name__, (kind,), {})


@derived
class Replaced:
    q: float = 1.0


def frozen(form):
    def decorate(kind):
        kind.defaults = form({key: getattr(kind, key) for key in kind.__annotations__})
        return kind

    return decorate


@frozen(types.MappingProxyType)
class Frozen:
    r: float = 1.0


@frozen(lambda defaults: tuple(defaults.items()))
class Paired:
    s: float = 1.0


@lambda kind: kind()
class Instance:
    t: float = 1.0


class Apart:
    u = 1.0
    MODES = {"u": 1.0, "fast": 2.0}


class Hiding(type):
    def __new__(kind, name, bases, names):
        made = super().__new__(kind, name, bases, {"kept": (names.pop("w", None),), **names})
        return made


class Hidden(metaclass=Hiding):
    w: float = 1.0


COUNT = 0


def count():
    global COUNT
    COUNT += 1


def last(q=7):
    return q'''


def at(name: str, function: str = "") -> FaultLocation:
    kind = AnchorKind.DEFAULT if function else AnchorKind.CONSTANT
    return FaultLocation(path="m.py", function=function, anchor=Anchor(kind=kind, name=name))


PLACES = {
    "LIMIT": (at("LIMIT"), lambda m: m.LIMIT),
    "LOW": (at("LOW"), lambda m: m.LOW),
    "Gains.P": (at("Gains.P"), lambda m: m.Gains().P),
    "Gains.I": (at("Gains.I"), lambda m: m.Gains.I),
    "a place's default": (at("x", "Gains.f"), lambda m: m.Gains.f()),
    "a keyword's default": (at("y", "Gains.f"), lambda m: m.Gains().f()),
    "a method's default": (at("z", "Gains.g"), lambda m: m.Gains().g()),
    "a function's default": (at("q", "last"), lambda m: m.last()),
    "a field": (at("Field.a"), lambda m: m.Field().a),
    "an inherited field": (at("Field.a"), lambda m: m.Slotted().a),
    "a field by keyword": (at("Field.c"), lambda m: m.Field().c),
    "a field's class attribute": (at("Field.c"), lambda m: m.Field.c),
    "a slot": (at("Slotted.d"), lambda m: m.Slotted().d),
    "a field of attrs": (at("Defined.e"), lambda m: m.Defined().e),
    "a private field of attrs": (at("Defined._f"), lambda m: m.Defined()._f),
    "an inherited field of attrs": (at("Defined.e"), lambda m: m.Derived().e),
    "a metaclass's copy": (at("Tabled.h"), lambda m: m.Tabled().h),
    "a decorator's copy": (at("Decorated.k"), lambda m: m.Decorated().k),
    "a table in a closure": (at("Closed.l"), lambda m: m.Closed().l),
    "a variable of a closure": (at("Single.m"), lambda m: m.Single().start),
    "a public table": (at("Listed.n"), lambda m: m.Listed.defaults["n"]),
    "a module's table by class": (at("Listed.n"), lambda m: m.ALL_DEFAULTS["Listed"]["n"]),
    "a base's table by class": (at("Listed.n"), lambda m: m.Base.by_class[m.Listed]["n"]),
    "a generated default": (at("Generated.p"), lambda m: m.Generated().p),
    "a replaced class": (at("Replaced.q"), lambda m: m.Replaced.q),
}


def mutant(clone: Workspace, *locations: FaultLocation) -> bytes:
    file = parse_file("m.py", SOURCE.encode(), Path("x"))
    edits = [
        injection_edit(
            file, clone.fault_models(), Injection(location=one, model="offset", params=(("by", 10.0),)), name
        )
        for one, name in zip(locations, ("a", "b", *(f"{n:08x}" for n in range(30))), strict=False)
    ]
    data = mutated_bytes(apply_edits(file, as_line_edits(file, [probe_import_edit(file, None), *edits])))
    assert unsplice(data) == file.data
    return data


@pytest.fixture
def load(clone: Workspace) -> Iterator[Callable[..., tuple[Any, Any]]]:
    """Load the module with injections at the given locations. Return the module and its probe, whose trigger
    is active from 1 s to 3 s."""
    names = ("_fi", "fixed_values_m")

    def made(*locations: FaultLocation) -> tuple[Any, Any]:
        nowhere = FaultLocation(path="", function="f", anchor=Anchor(kind=AnchorKind.ENTRY))
        observation = Observation(location=nowhere, time="t", values=(), derived=())
        trigger = Trigger(name="test", condition="t >= 1 and t < 3")
        settings = contract.build_probe_settings(
            "m", trigger, Hold.WHILE, ("a", "b"), observation, 1.0, sets=True
        )
        probe, module = (types.ModuleType(name) for name in names)
        models = clone.fault_models()
        exec(contract.render_probe(models.probe_templates, settings).text, vars(probe))
        sys.modules |= {"_fi": probe, names[1]: module}
        exec(compile(mutant(clone, *locations), "m.py", "exec", dont_inherit=True), vars(module))
        return module, probe

    yield made
    for name in names:
        sys.modules.pop(name, None)


@pytest.mark.parametrize("place", PLACES)
def test_a_fixed_value_changes_while_the_fault_is_active(
    load: Callable[..., tuple[Any, Any]], place: str
) -> None:
    location, value = PLACES[place]
    module, fi = load(location)
    original, seen = value(module), []
    for t in (0, 1, 2, 3, 4, 0, 1, 2, 0):
        fi.observe(t=float(t))
        seen.append(value(module) - original)
    assert seen == [0, 10, 10, 0, 0, 0, 10, 10, 0]
    fi.observe(t=1.0)
    assert fi.report()["injections"]["a"] == {"first": 1.0, "last": 1.0, "count": 1}


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Hidden.w", "Hiding, the metaclass of Hidden, keeps the value where it cannot be set"),
        ("Frozen.r", "Frozen keeps a copy of r in a mappingproxy, where it cannot be set"),
        ("Paired.s", "Paired keeps a copy of s in a tuple, where it cannot be set"),
        ("Instance.t", "Instance is no class at run time, but of type Instance"),
    ],
)
def test_a_value_that_cannot_be_set_is_reported(
    load: Callable[..., tuple[Any, Any]], name: str, reason: str
) -> None:
    """The fault is never counted as active, no part of it is set, and the report says why."""
    module, fi = load(at(name))
    owner, _, key = name.partition(".")
    original = getattr(getattr(module, owner), key, None)
    fi.observe(t=1.0)
    report = fi.report()
    assert getattr(getattr(module, owner), key, None) == original
    assert report["injections"]["a"]["count"] == 0
    assert report["unset"] == {"a": reason}


def test_tables_of_other_classes_and_other_dicts_stay(load: Callable[..., tuple[Any, Any]]) -> None:
    """Only copies change: not an equal value of another class, nor a dict with other keys than the fields."""
    module, fi = load(at("Listed.n"), at("Apart.u"))
    fi.observe(t=1.0)
    assert (module.Listed.n, module.Apart.u) == (11.0, 11.0)
    assert module.Beside.defaults == module.ALL_DEFAULTS["Beside"] == {"n": 1.0}
    assert module.Below.n == 11.0
    assert module.Apart.MODES == {"u": 1.0, "fast": 2.0}


def test_tagged_lines_follow_the_statement_that_sets_the_value(clone: Workspace) -> None:
    lines = mutant(clone, *dict.fromkeys(one for one, _ in PLACES.values())).decode().splitlines()
    tagged = [i for i, line in enumerate(lines) if "# fi:" in line][1:]
    assert [lines[i - 1].strip() for i in tagged if i - 1 not in tagged] == [
        "LIMIT = 5",
        "LOW = 2",
        "P = 1.0; I = 2.0",
        "return x + y",
        "def g(self, z=9): return z",
        "a: float = 1.0",
        "c: int = field(default=3, kw_only=True)",
        "d: int = 4",
        "e: float = 1.0",
        "_f: int = attrs.field(default=2, kw_only=True)",
        "h: float = 1.0",
        "k: float = 1.0",
        "l: float = 1.0",
        "m: float = 1.0",
        "n = 1.0",
        "p: float = 1.0",
        "q: float = 1.0",
        "return q",
    ]
    assert lines[7:9] == ["", "LIMIT = 5"]
    assert lines[9] == '_fi.constant("a", globals(), "LIMIT", lambda original: original + 10)  # fi:a'


@pytest.mark.parametrize(
    ("location", "words"),
    [
        (at("LIMITS"), "no constant 'LIMITS'; expected one of LIMIT, LOW, .*did you mean 'LIMIT'"),
        (at("q", "Gains.f"), "no default 'q' in Gains.f; expected one of x, y"),
        (at("self", "Gains.h"), "there is none of this kind"),
        (at("x", "Gains.gone"), "no function 'Gains.gone'"),
        (at("Field.b"), "m.py:32: the constant 'Field.b' cannot be set: the field has no default"),
        (at("Gear.DRIVE"), "its class derives from Enum"),
        (at("COUNT"), "a function also sets it"),
    ],
)
def test_an_unsuitable_value_is_refused(clone: Workspace, location: FaultLocation, words: str) -> None:
    with pytest.raises(MutatorError, match=words):
        mutant(clone, location)


def test_a_model_that_changes_no_value_is_refused(clone: Workspace) -> None:
    file = parse_file("m.py", SOURCE.encode(), Path("x"))
    for model, params in (("omission", ()), ("offset", (("by", 1.0), ("target", "LOW")))):
        with pytest.raises(MutatorError, match=r"cannot change the value|expected no variable"):
            injection_edit(
                file, clone.fault_models(), Injection(location=at("LIMIT"), model=model, params=params), "a"
            )


def test_modules_that_import_a_constant_are_found(tmp_path: Path) -> None:
    files = {
        "pkg/__init__.py": "from .limits import LIMIT\n",
        "pkg/limits.py": "LIMIT = 5\n",
        "pkg/sub/a.py": "from ..limits import LIMIT as L\nfrom .. import limits\n",
        "pkg/sub/b.py": "from pkg import LIMIT\n\ndef f():\n    from pkg.limits import LIMIT\n",
        "other.py": "from limits import LIMIT\n",
    }
    for path, text in files.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    tree = read_tree(tmp_path, ["**"])
    assert sorted(dotted_names_importing_constant(tree, "pkg/limits.py", "LIMIT")) == [
        "pkg.LIMIT",
        "pkg.sub.a.L",
        "pkg.sub.b.LIMIT",
    ]


def test_imports_that_cannot_be_changed_are_listed(tmp_path: Path) -> None:
    texts = {
        "limits": "LIMIT = 5\n",
        "a": "from limits import *\n",
        "b": "class C:\n    from limits import LIMIT\n",
        "c": "from limits import LIMIT\nLIMIT += 1\n",
    }
    texts |= {"kept": "__all__ = ['other']\nLIMIT, other = 1, 2\n", "d": "from kept import *\n"}
    for name, text in texts.items():
        (tmp_path / f"{name}.py").write_text(text)
    assert dotted_names_importing_constant(read_tree(tmp_path, ["**"]), "kept.py", "LIMIT") == (), (
        "`*` does not include it"
    )
    words = "a.py:1 imports \\*; b.py:2 imports it into a class; c.py:1 imports it, and also sets LIMIT in"
    with pytest.raises(MutatorError, match=words):
        dotted_names_importing_constant(read_tree(tmp_path, ["**"]), "limits.py", "LIMIT")
