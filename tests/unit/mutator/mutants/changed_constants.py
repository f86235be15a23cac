"""A module with constants and defaults of all kinds, and mutants that change them."""

from pathlib import Path

from mutator.model import Anchor, AnchorKind, FaultLocation, Injection
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, probe_import_edit, unsplice
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
            file,
            clone.fault_models(),
            Injection(location=location, model="offset", params=(("by", 10.0),)),
            name,
        )
        for location, name in zip(locations, ("a", "b", *(f"{n:08x}" for n in range(30))), strict=False)
    ]
    data = mutated_bytes(apply_edits(file, as_line_edits(file, [probe_import_edit(file, None), *edits])))
    assert unsplice(data) == file.data
    return data
