"""Molds give what splicing gives, in files of every form."""

import shutil
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection, Value
from mutator.mutants import splicing as splice
from mutator.mutants.anchors import parse_file
from mutator.mutants.building import InvalidMutant, build, build_directly
from mutator.mutants.patches import changed_file
from mutator.mutants.shapes import Change, Mold, lines_of, proven, shape_of
from mutator.triggers.kinds import always
from mutator.workspace import Workspace

TEXTS = [
    "def f():\n    x = 1\n    return x\n",
    "def f():\r\n    x = 1\r\n    return x\r\n",
    "def f():\n    x = 1",
    "def f():\r\n    x = 1",
    "def f():\n\tx = (\n\t  1)\n\treturn x\n",
    "# coding: latin-1\ndef f():\n    x = '\xe9'\n",
]
SENSOR = "toycar/sensor.py"


def change(text: str, code: str, name: str, guard: bool) -> tuple[Mold, Change, list[bytes], bool]:
    """A direct change with its mold and lines, and whether the mold is proven."""
    file = parse_file("m.py", text.encode("latin-1" if "latin" in text else "utf-8"), Path("root"))
    kind = AnchorKind.BEFORE_ASSIGN if guard else AnchorKind.AFTER_ASSIGN
    site = file.resolve(FaultLocation(path="m.py", function="f", anchor=Anchor(kind=kind, name="x")))
    make = splice.guard if guard else splice.insertion
    edits = [make(file, site, [code], name), splice.probe_import(file, "pack")]
    pieces = splice.apply(file, edits)
    made = Change(data=splice.joined(pieces), patch=changed_file("m.py", pieces))
    mold = Mold.of(made)
    return mold, made, lines_of(edits), proven(file, mold, shape_of(file, edits, [name]))


@pytest.mark.parametrize("guard", [False, True])
@pytest.mark.parametrize("text", TEXTS)
def test_a_mold_filled_is_the_change(text: str, guard: bool) -> None:
    """The mold of one change, filled with the lines of another of its shape, gives the other."""
    code = "if _fi.active('{}', {}):" if guard else "x = _fi.held('{}', {})"
    mold, _, _, good = change(text, code.format("00000001", 3.25), "00000001", guard)
    other, made, lines, _ = change(text, code.format("abcdefab", 1e-300), "abcdefab", guard)
    assert good
    assert mold == other
    assert mold.filled(lines) == made


def test_a_mold_that_proves_nothing_is_not_proven() -> None:
    """What compiles with these numbers, but not with all, is never taken for proven."""
    assert not change(TEXTS[0], "x = 12345678", "12345678", False)[3]


def fault(value: Value, **location: object) -> Fault:
    """`gap = value` in the toy's sensor, or somewhere."""
    anchor = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="gap")
    place = FaultLocation(**{"path": SENSOR, "function": "Sensor.measure", "anchor": anchor, **location})
    injection = Injection(location=place, model="stuck", params=(("target", "gap"), ("value", value)))
    return Fault(
        spec="s",
        module="m",
        fault_type="f",
        reading="r",
        value=None,
        unit="-",
        aim="H1",
        injections=(injection,),
    )


def test_a_shape_is_made_once(toy: Workspace) -> None:
    """Another number needs no other mold; a sign or a number that is none does."""
    manifest, models = toy.manifest("toy"), toy.fault_models()
    molds = manifest.tree.parsed(SENSOR).molds
    counts = []
    for value in (1.0, 2.5, 1e-9, -1.0, float("nan"), 3, None):
        assert build(manifest, models, fault(value), always()) == build_directly(
            manifest, models, fault(value), always()
        )
        counts.append(len(molds))
    assert counts == [1, 1, 1, 2, 3, 4, 5]


def test_errors_are_those_of_the_direct_way(toy: Workspace, tmp_path: Path) -> None:
    """A mutant that cannot be made is refused in the same words, also when its like was made before."""
    templates = Path(shutil.copytree(toy.templates, tmp_path / "templates"))
    (templates / "stuck.py.j2").write_text(
        "match {{ target }}:\n    case {1: a, {{ value }}: b}:\n        {{ target }} = a\n"
    )
    manifest = toy.manifest("toy")
    models = Workspace(library=toy.library, templates=templates).fault_models()
    build(manifest, models, fault(2), always())
    for wrong in (
        fault(1),
        fault(2, function="Sensor.mesure"),
        fault(True),
        fault("gap"),
        fault(2, path="../x"),
    ):
        said = []
        for way in (build, build_directly):
            with pytest.raises(MutatorError) as caught:
                way(manifest, models, wrong, always())
            said.append((type(caught.value), str(caught.value)))
        assert said[0] == said[1]
    with pytest.raises(InvalidMutant, match="does not compile"):
        build(manifest, models, fault(1), always())
