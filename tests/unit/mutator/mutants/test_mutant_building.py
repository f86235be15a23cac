"""Mutants are built, compiled, compared, identified, written and run."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mutator.errors import InvalidMutant, MutatorError
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Hold, Injection, Trigger
from mutator.mutants import mutant_building
from mutator.mutants.mutant_building import Mutant, write_mutated_tree
from mutator.mutants.probe_contract import probe_path
from mutator.mutants.splicing import unsplice
from mutator.targets.source_tree import read_tree
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time
from mutator.workspace import Workspace

GOLDEN = Path(__file__).parents[1] / "toy" / "golden"
CLOSING = Trigger(name="closing", condition="hwt <= 3.0 and rs > 0.0", armed_after_s=0.5)


def toy_faults(toy: Workspace, reading: str = "as_described") -> dict[str, Fault]:
    found = expand_spec(
        toy.spec("sensor/distance"), 3, reading, models=toy.fault_models(), manifest=toy.manifest("toy")
    )
    return {fault.spec.rpartition("/")[2]: fault for fault in reversed(found)}


def build(toy: Workspace, fault: Fault | None, trigger: Trigger = CLOSING) -> Mutant:
    return mutant_building.build(toy.manifest("toy"), toy.fault_models(), fault, trigger)


def one(**location: object) -> Fault:
    """Return a handwritten fault, `gap = 3.0`, at the given location."""
    anchor = Anchor(kind=AnchorKind.AFTER_ASSIGN, name="gap")
    values = {"path": "toycar/sensor.py", "function": "Sensor.measure", "anchor": anchor, **location}
    params = (("target", "gap"), ("value", 3.0))
    injection = Injection(location=FaultLocation(**values), model="stuck", params=params)
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


@pytest.mark.parametrize("variant", ["longer", "silent", "both", "null"])
def test_diffs_equal_the_stored_diffs(toy: Workspace, variant: str) -> None:
    """Only the beginning of the probe is compared."""
    fault = None if variant == "null" else toy_faults(toy)[variant]
    made = build(toy, fault)
    patch = made.patch.replace(made.id, "<id>")
    head, _, rest = patch.partition("+_TINY = 1e-9\n")
    shown = head + "...\n" + rest[rest.index("diff --git") :]
    path = GOLDEN / f"{variant}.patch"
    if os.environ.get("UPDATE_GOLDEN"):
        path.write_text(shown)
    assert shown == path.read_text()


@pytest.mark.parametrize("variant", ["longer", "silent", "both", "null"])
def test_only_tagged_lines_differ(toy: Workspace, variant: str) -> None:
    manifest = toy.manifest("toy")
    made = build(toy, None if variant == "null" else toy_faults(toy)[variant])
    assert set(made.files) - set(manifest.tree.files) == {"toycar/_fi.py"}
    for path, data in made.files.items():
        compile(data, path, "exec")
        if path != "toycar/_fi.py":
            assert data != manifest.tree.files[path]
            assert unsplice(data) == manifest.tree.files[path]


@pytest.mark.parametrize("name", ["toycar/_fi.py", "toycar/_fi/__init__.py"])
def test_a_module_with_the_probes_name_is_refused(toy: Workspace, name: str) -> None:
    path = toy.manifest("toy").root / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("x = 1\n")
    with pytest.raises(MutatorError, match=rf"the target has a file {name}; expected no file of this name"):
        build(toy, None)


def test_the_patch_the_tree_and_the_digest_agree(toy: Workspace, tmp_path: Path) -> None:
    manifest = toy.manifest("toy")
    before = manifest.tree.digest
    made = build(toy, toy_faults(toy)["both"])
    files = (*manifest.file_globs, probe_path(manifest.probe_package))
    write_mutated_tree(manifest, made, tmp_path / "tree")
    assert read_tree(tmp_path / "tree", files).digest == made.tree_digest != before
    if shutil.which("patch"):
        shutil.copytree(manifest.root, tmp_path / "copy")
        subprocess.run(["patch", "-p1", "-s"], cwd=tmp_path / "copy", input=made.patch_bytes, check=True)
        assert read_tree(tmp_path / "copy", files).digest == made.tree_digest
    assert toy.manifest("toy").tree.digest == before


def test_ids_depend_on_everything_that_determines_a_mutant(toy: Workspace) -> None:
    faults = toy_faults(toy)
    first = build(toy, faults["longer"])
    assert first == build(toy, faults["longer"])
    others = [
        build(toy, faults["both"]),
        build(toy, None),
        build(toy, faults["longer"], always_trigger()),
        build(toy, faults["longer"], trigger_at_time(3.0)),
    ]
    target = toy.manifest("toy").root / "toycar" / "judge.py"
    target.write_text(target.read_text() + "\n")
    others.append(build(toy, faults["longer"]))
    assert len({first.id, *(m.id for m in others)}) == 6
    assert len({first.tree_digest, *(m.tree_digest for m in others)}) == 6


def test_the_hold_of_a_fault_overrides_the_hold_of_the_trigger(toy: Workspace) -> None:
    assert b'HOLD = "while"' in build(toy, toy_faults(toy)["longer"]).files["toycar/_fi.py"]
    assert b'HOLD = "to_end"' in build(toy, toy_faults(toy)["silent"]).files["toycar/_fi.py"]


def run(toy: Workspace, made: Mutant, place: Path, steps: int = 100) -> dict[str, object]:
    write_mutated_tree(toy.manifest("toy"), made, place / "tree")
    program = (
        "import json; from toycar.world import World; from toycar import _fi; w = World(); gaps = []\n"
        f"for _ in range({steps}): w.step(); gaps.append(w.gap)\n"
        "print(json.dumps({'gaps': gaps, 'report': _fi.report()}))"
    )
    environment = {"PYTHONPATH": str(place / "tree"), "PATH": os.environ["PATH"]}
    done = subprocess.run(
        [sys.executable, "-B", "-c", program], env=environment, capture_output=True, check=True, text=True
    )
    return dict(json.loads(done.stdout))


def test_faults_are_active_once_their_trigger_fires(toy: Workspace, tmp_path: Path) -> None:
    null = run(toy, build(toy, None), tmp_path / "null")
    assert null["report"]["injections"] == {}
    assert null["report"]["triggered"]["first"] == 0.5
    for name in ("longer", "silent", "both"):
        made = build(toy, toy_faults(toy)[name], trigger_at_time(2.0))
        result = run(toy, made, tmp_path / name)
        gaps, golden = result["gaps"], null["gaps"]
        assert gaps[:20] == golden[:20] and gaps != golden
        report = result["report"]
        assert report["mutant"] == made.id
        assert set(report["injections"]) == set(made.injection_ids)
        assert all(i["first"] == 2.0 and i["count"] == 80 for i in report["injections"].values())


@pytest.mark.parametrize(
    ("location", "said"),
    [
        ({"path": "../toycar/sensor.py"}, "leads out of the target"),
        ({"path": "toycar/judge.py"}, "no fault may be injected into file"),
        ({"function": "Sensor.mesure"}, "did you mean 'Sensor.measure'?"),
        ({"anchor": Anchor(kind=AnchorKind.AFTER_ASSIGN, name="rate", nth=2)}, "matches 1 statement "),
        (
            {"function": "Sensor.send", "anchor": Anchor(kind=AnchorKind.ENTRY)},
            "'gap' is not known in Sensor.send",
        ),
    ],
)
def test_locations_of_handwritten_faults_are_checked(
    toy: Workspace, location: dict[str, object], said: str
) -> None:
    """Locations in a spec are checked earlier, when the spec is expanded."""
    with pytest.raises(MutatorError) as caught:
        build(toy, one(**location))
    assert said in str(caught.value)


def test_a_mutant_that_does_not_compile_is_invalid(toy: Workspace, tmp_path: Path) -> None:
    templates = Path(shutil.copytree(toy.templates, tmp_path / "templates"))
    (templates / "stuck.py.j2").write_text("nonlocal {{ target }}\n")
    broken = Workspace(library=toy.library, templates=templates)
    with pytest.raises(
        InvalidMutant, match=r"sensor.py.*does not compile: .*nonlocal.*at `nonlocal gap  # fi:"
    ):
        build(broken, one())


def test_an_invalid_trigger_is_refused(toy: Workspace) -> None:
    with pytest.raises(MutatorError, match="is not a truth value"):
        build(toy, None, Trigger(name="x", condition="__import__('os')"))
    with pytest.raises(MutatorError, match="without a time; expected `hold_s`"):
        build(toy, None, Trigger(name="x", condition="True", hold=Hold.FOR))


def test_a_file_at_the_probes_path_is_refused(toy: Workspace) -> None:
    (toy.manifest("toy").root / "toycar" / "_fi.py").write_text("x = 1\n")
    with pytest.raises(MutatorError, match=r"the target has a file toycar/_fi.py"):
        build(toy, None)
