"""Reusable changes give the same result as splicing, in files of every form."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.errors import InvalidMutant, MutatorError
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection, Value
from mutator.mutants import mutant_building, splicing
from mutator.mutants.changed_file_reuse import (
    ChangedFile,
    ReusableChangedFile,
    compiles_for_every_mutant,
    inserted_lines,
    reuse_cache,
    reuse_key,
)
from mutator.mutants.mutant_building import build, build_without_reusing_changed_files
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.patch_rendering import render_changed_file
from mutator.triggers.trigger_kinds import always_trigger
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


def change(
    text: str, code: str, name: str, guard: bool
) -> tuple[ReusableChangedFile, ChangedFile, list[bytes], bool]:
    """Return the reusable change, the spliced change, the inserted lines, and whether all changes of this
    kind compile."""
    file = parse_file("m.py", text.encode("latin-1" if "latin" in text else "utf-8"), Path("root"))
    kind = AnchorKind.BEFORE_ASSIGN if guard else AnchorKind.AFTER_ASSIGN
    site = file.resolve_statement(
        FaultLocation(path="m.py", function="f", anchor=Anchor(kind=kind, name="x"))
    )
    make = splicing.guard_edit if guard else splicing.insertion_edit
    edits = [make(file, site, [code], name), splicing.probe_import_edit(file, "pack")]
    pieces = splicing.apply_edits(file, edits)
    made = ChangedFile(data=splicing.mutated_bytes(pieces), patch=render_changed_file("m.py", pieces))
    reusable = ReusableChangedFile.from_changed_file(made)
    compiles = compiles_for_every_mutant(file, reusable, reuse_key(file, edits, [name]))
    return reusable, made, inserted_lines(edits), compiles


@pytest.mark.parametrize("guard", [False, True])
@pytest.mark.parametrize("text", TEXTS)
def test_a_reusable_change_equals_the_spliced_one(text: str, guard: bool) -> None:
    code = "if _fi.active('{}', {}):" if guard else "x = _fi.held('{}', {})"
    reusable, _, _, compiles = change(text, code.format("00000001", 3.25), "00000001", guard)
    other, made, lines, _ = change(text, code.format("abcdefab", 1e-300), "abcdefab", guard)
    assert compiles
    assert reusable == other
    assert reusable.with_inserted_lines(lines) == made


@pytest.mark.parametrize("text", TEXTS)
def test_a_change_of_a_value_and_inserted_lines_can_be_reused_together(text: str) -> None:
    file = parse_file("m.py", text.encode("latin-1" if "latin" in text else "utf-8"), Path("root"))

    def changed(name: str, value: str) -> tuple[ReusableChangedFile, ChangedFile, list[bytes]]:
        anchor = Anchor(kind=AnchorKind.ASSIGNED_VALUE, name="x")
        value_at = file.resolve_expression(FaultLocation(path="m.py", function="f", anchor=anchor))
        after = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="x")
        site = file.resolve_statement(FaultLocation(path="m.py", function="f", anchor=after))
        observes = splicing.insertion_edit(file, site, ["_fi.observe(t=x)"], "observe")
        edits = splicing.as_line_edits(
            file, [observes, splicing.expression_edit(file, value_at, value, name)]
        )
        pieces = splicing.apply_edits(file, edits)
        made = ChangedFile(data=splicing.mutated_bytes(pieces), patch=render_changed_file("m.py", pieces))
        reusable = ReusableChangedFile.from_changed_file(made)
        assert splicing.unsplice(made.data) == file.data
        assert compiles_for_every_mutant(file, reusable, reuse_key(file, edits, [name]))
        return reusable, made, inserted_lines(edits)

    (reusable, *_), (other, made, lines) = changed("00000001", "3.25"), changed("abcdefab", "1e-300")
    assert reusable == other
    assert reusable.with_inserted_lines(lines) == made


def test_a_change_that_compiles_only_with_some_values_is_not_reused() -> None:
    assert not change(TEXTS[0], "x = 12345678", "12345678", False)[3]


def fault(value: Value, **location: object) -> Fault:
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


def test_a_change_is_reused_for_another_number(toy: Workspace) -> None:
    """A different sign, a different type or a non-finite value needs a new change."""
    manifest, models = toy.manifest("toy"), toy.fault_models()
    known = reuse_cache(manifest.tree, SENSOR)
    counts = []
    for value in (1.0, 2.5, 1e-9, -1.0, float("nan"), 3, None):
        assert build(manifest, models, fault(value), always_trigger()) == build_without_reusing_changed_files(
            manifest, models, fault(value), always_trigger()
        )
        counts.append(len(known))
    assert counts == [1, 1, 1, 2, 3, 4, 5]


def test_a_reused_change_gives_the_same_errors(toy: Workspace, tmp_path: Path) -> None:
    templates = Path(shutil.copytree(toy.templates, tmp_path / "templates"))
    (templates / "stuck.py.j2").write_text(
        "match {{ target }}:\n    case {1: a, {{ value }}: b}:\n        {{ target }} = a\n"
    )
    manifest = toy.manifest("toy")
    models = Workspace(library=toy.library, templates=templates).fault_models()
    build(manifest, models, fault(2), always_trigger())
    for wrong in (
        fault(1),
        fault(2, function="Sensor.mesure"),
        fault(True),
        fault(2, path="../x"),
    ):
        said = []
        for way in (build, build_without_reusing_changed_files):
            with pytest.raises(MutatorError) as caught:
                way(manifest, models, wrong, always_trigger())
            said.append((type(caught.value), str(caught.value)))
        assert said[0] == said[1]
    with pytest.raises(InvalidMutant, match="does not compile"):
        build(manifest, models, fault(1), always_trigger())


def test_a_fault_is_spliced_once_for_all_triggers(toy: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each mutant is what it is without reuse, also for a manifest of the same tree that forbids the file."""
    manifest, models, stuck = toy.manifest("toy"), toy.fault_models(), fault(1.0)
    spliced = []
    edits_of = mutant_building.edits_of
    monkeypatch.setattr(mutant_building, "edits_of", lambda *args: spliced.append(args) or edits_of(*args))
    triggers = [replace(always_trigger(), condition=text) for text in ("t >= 1.0", "t >= 2.5", "t >= 1.0")]
    mutants = [build(manifest, models, stuck, trigger) for trigger in triggers]
    assert len(spliced) == 1
    assert mutants == [build_without_reusing_changed_files(manifest, models, stuck, t) for t in triggers]
    with pytest.raises(MutatorError, match="forbid"):
        build(replace(manifest, forbidden_globs=(SENSOR,)), models, stuck, triggers[0])
