"""Target manifests."""

from pathlib import Path

import pytest

from mutator._common import cache_layout_and_pruning
from mutator.errors import MutatorError, UnsafePath
from mutator.faults.spec_expansion import expand_spec
from mutator.model import AnchorKind
from mutator.mutants.mutant_building import build
from mutator.targets.manifest_files import load_manifest
from mutator.targets.source_tree import matches_any_glob, read_tree
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

FILM = 'film: {run: ["x={film}"], module: show, args: ["{out}"], still: ["{film}"]}'


def test_a_manifest_is_read(toy: Workspace) -> None:
    manifest = toy.manifest("toy")
    assert manifest.root == (toy.library.parent / "target").resolve()
    assert manifest.step_s == 0.1
    assert [(c.name, c.unit, c.tolerance) for c in manifest.compared_channels] == [("speed", "m/s", 0.5)]
    assert manifest.observation.location.anchor.kind is AnchorKind.AFTER_ASSIGN
    assert dict(manifest.observation.name_expression_pairs)["v_lead"] == "now.lead_speed"


def test_actuators_have_no_default_tolerance(toy: Workspace) -> None:
    path = toy.library / "targets" / "toy.yaml"
    kept = "{unit: m/s, role: actuator, tolerance: 0.5}"
    more = ("pedal: {unit: '-', role: actuator}", "wish: {unit: m}", "gap: {unit: m, tolerance: 0}")
    path.write_text(path.read_text().replace(kept, "\n  ".join((kept, *more))))
    found = {c.name: c.tolerance for c in toy.manifest("toy").channels}
    assert found == {"speed": 0.5, "pedal": 0.0, "wish": 1e-9, "gap": 0.0}


def test_ground_truth_can_be_computed(toy: Workspace) -> None:
    path = toy.library / "targets" / "toy.yaml"
    text = path.read_text().replace("is: now.gap", "is: 'now[\"lead\"].x[-1] - (now.x + 4.5)'")
    path.write_text(text.replace("is: now.lead_speed", "is: 'hypot(now.v[0], now.v[1]) > 3'"))
    expressions = dict(toy.manifest("toy").observation.name_expression_pairs)
    assert expressions["d_rel"] == "now['lead'].x[-1] - (now.x + 4.5)"
    assert expressions["v_lead"] == "_fi.hypot(now.v[0], now.v[1]) > 3"


@pytest.mark.parametrize(
    ("schema", "remedy"),
    [("target/1", "start the file with `schema: target/2`"), ("target/3", "use a newer version of mutator")],
)
def test_a_manifest_of_another_schema_is_refused(toy: Workspace, schema: str, remedy: str) -> None:
    path = toy.library / "targets" / "toy.yaml"
    path.write_text(path.read_text().replace("target/2", schema))
    with pytest.raises(MutatorError, match=rf"toy\.yaml:1: schema '{schema}'; expected target/2; {remedy}"):
        toy.manifest("toy")


def test_arguments_have_placeholders_and_changes(toy: Workspace) -> None:
    manifest = toy.manifest("toy")
    given = manifest.run_arguments(scenario=Path("s.yaml"), seed=3, out=Path("o"), changes=("alone",))
    assert given == ("s.yaml", "--seed", "3", "--out", "o", "--alone", "--quiet")
    with pytest.raises(MutatorError, match="change 'no_lead'; expected one of alone"):
        manifest.run_arguments(scenario=Path("s"), seed=0, out=Path("o"), changes=("no_lead",))


def test_placeholders_can_be_anywhere_in_an_argument(toy: Workspace) -> None:
    path = toy.library / "targets" / "toy.yaml"
    text = path.read_text().replace("alone: [--alone, --quiet]", 'alone: ["--in={out}/x", \'{"a": {}}\']')
    text = text.replace("  changes:", '  independent: ["--log={out}:{seed}"]\n  changes:')
    path.write_text(text)
    given = toy.manifest("toy").run_arguments(
        scenario=Path("s{seed}.yaml"), seed=3, out=Path("o"), changes=("alone",), independent=True
    )
    assert given == ("s{seed}.yaml", "--seed", "3", "--out", "o", "--log=o:3", "--in=o/x", '{"a": {}}')


def test_without_arguments_the_entry_gets_options(toy: Workspace) -> None:
    path = toy.library / "targets" / "toy.yaml"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if not line.startswith("  args:")))
    given = toy.manifest("toy").run_arguments(scenario=Path("s"), seed=3, out=Path("o"))
    assert given == ("--scenario", "s", "--seed", "3", "--out", "o")


def test_every_run_has_the_same_cache_folder(toy: Workspace) -> None:
    path = toy.library / "targets" / "toy.yaml"
    path.write_text(path.read_text().replace('"{out}"', '"{out}", --cache, "{cache}"'))
    manifest = toy.manifest("toy")
    for independent in (False, True):
        given = manifest.run_arguments(scenario=Path("s"), seed=0, out=Path("o"), independent=independent)
        assert given[given.index("--cache") + 1] == str(cache_layout_and_pruning.target_cache_folder("toy"))


def test_a_film_adds_arguments(toy: Workspace) -> None:
    with pytest.raises(MutatorError, match=r"target toy cannot be filmed; expected `film` in its manifest"):
        toy.manifest("toy").with_film_recording()
    path = toy.library / "targets" / "toy.yaml"
    film = 'film: {run: [--film, "{film}"], module: toycar.show, args: [], still: []}\n'
    plain = path.read_text()
    path.write_text(plain + film)
    filmed = toy.manifest("toy").with_film_recording()
    given = filmed.run_arguments(scenario=Path("s.yaml"), seed=3, out=Path("o"))
    assert given == (
        *toy.manifest("toy").run_arguments(scenario=Path("s.yaml"), seed=3, out=Path("o")),
        "--film",
        "o/film",
    )
    path.write_text(plain + film.replace("module", 'run_for_still: [--at, "{t}"], module'))
    for_stills = toy.manifest("toy").with_film_recording([1.5, 2.0])
    given_for_stills = for_stills.run_arguments(scenario=Path("s.yaml"), seed=3, out=Path("o"))
    assert given_for_stills == (*given, "--at", "1.5", "--at", "2.0")
    assert filmed.tree.digest == toy.manifest("toy").tree.digest
    path.write_text(plain + film.replace("toycar.show", "toycar/show"))
    with pytest.raises(MutatorError, match="'toycar/show'; expected a dotted module name"):
        toy.manifest("toy")


def test_the_root_can_be_given(toy: Workspace, tmp_path: Path) -> None:
    path = toy.library / "targets" / "toy.yaml"
    other = tmp_path / "other"
    (other / "toycar").mkdir(parents=True)
    assert load_manifest(path, other).root == other.resolve()
    with pytest.raises(MutatorError, match=r"toy.yaml:3: no folder .*none.*MUTATOR_TARGET"):
        load_manifest(path, tmp_path / "none")


def test_the_root_can_be_the_shipped_controller(toy: Workspace) -> None:
    path = toy.library / "targets" / "toy.yaml"
    text = path.read_text()
    line = next(line for line in text.splitlines() if line.startswith("root:"))
    path.write_text(text.replace(line, "root: shipped:target"))
    assert (load_manifest(path).root / "selfdrive" / "sim" / "run.py").is_file()
    path.write_text(text.replace(line, "root: shipped:other"))
    with pytest.raises(
        MutatorError, match=r"toy.yaml:3: no folder .*relative to this file, or shipped:target"
    ):
        load_manifest(path)


def test_a_manifest_is_a_snapshot(toy: Workspace) -> None:
    manifest = toy.manifest("toy")
    before = manifest.tree
    (manifest.root / "toycar" / "__pycache__").mkdir()
    (manifest.root / "toycar" / "__pycache__" / "x.py").write_text("x")
    (manifest.root / "toycar" / "world.pyc").write_text("x")
    assert toy.manifest("toy").tree.digest == before.digest
    (manifest.root / "toycar" / "world.py").write_text("x = 1\n")
    assert manifest.tree is before
    assert toy.manifest("toy").tree.digest != before.digest


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("package: toycar", "package: toy-car", "4: 'toy-car'; expected a Python package's name"),
        ("module: toycar.run", "module: toycar/run", "9: 'toycar/run'; expected a dotted module name"),
        (
            "  module: toycar.run",
            "  module: toycar.run\n  stepwise: Run..open",
            "10: 'Run..open'; expected a function of the entry module",
        ),
        (
            "file: trace.npz",
            "file: ../trace.npz",
            "12: '../trace.npz'; expected a bare file name",
        ),
        ("step_s: 0.1", "step_s: 0", "7: 0 for 'step_s'; expected greater than or equal to 0.000001"),
        ("step_s: 0.1", "step_s: .inf", "7: inf for 'step_s'; expected a finite number"),
        ("tolerance: 0.5", "tolerance: -1", "15: -1 for 'tolerance'"),
        ("time: now.time", "time: now.time()", "18: 'now.time()'; expected names, attributes"),
        ("time: now.time", "time: '[0][0]'", "18: '[0][0]'; expected names, attributes"),
        ("time: now.time", "time: _fi.x", "18: '_fi.x'; expected names, attributes"),
        ("is: now.gap", "is: 'now[i]'", "20: 'now[i]'; expected names, attributes, items with constant keys"),
        ("is: now.gap", "is: 'open(\"x\")'", "20: 'open(\"x\")'; expected names, attributes"),
        ("    d_rel:", "    t:", "20: 't'; expected a unique name of letters, digits and _, none of"),
        ("    hwt:", "    d_rel:", "24: 'd_rel'; expected a unique name of letters, digits and _"),
        ("is: v_ego - v_lead", "is: v_ego - v_leed", "25: unknown name 'v_leed' in 'v_ego - v_leed'"),
        ("file: toycar/world.py", "file: ../world.py", "17: path '../world.py' leads out of the target"),
        (
            '"{seed}"',
            '"{sed}"',
            "10: '{sed}' in '{sed}'; expected one of {scenario}, {seed}, {out}, {cache}, {",
        ),
        ('"{out}"', '"--out={film}"', "10: '{film}' in '--out={film}'; expected one of {scenario}"),
        ("[--alone,", "['{outt}',", "'{outt}' in '{outt}'; expected one of {scenario}"),
        (
            "alerts: [beep]",
            f"{FILM}\nalerts: [beep]",
            "27: '{film}' in '{film}'; expected one of {golden}",
        ),
        ("hazards: [H1]", "hazards: [H1, alert]", "26: hazard 'alert' clashes"),
        ("hazards: [H1]", "hazards: [H1, h1]", "26: 'h1'; expected a unique name"),
        ("alerts: [beep]", "alerts: [beep;boop]", "27: 'beep;boop'; expected a unique name"),
        ("  derived:", "  deriven:", "23: unknown key 'deriven'; expected one of at, time, values, derived"),
    ],
)
def test_a_mistake_in_a_manifest_is_reported(toy: Workspace, old: str, new: str, said: str) -> None:
    path = toy.library / "targets" / "toy.yaml"
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        toy.manifest("toy")
    assert said in str(caught.value).replace(f"{path}:", "")


@pytest.mark.parametrize(
    ("packages", "package", "names"),
    [
        ("package: toycar", "toycar", ("toycar",)),
        ("packages: [toycar]", "toycar", ("toycar",)),
        ("packages: [toycar, drive.py]", None, ("toycar", "drive")),
        ("packages: [drive.py]", None, ("drive",)),
    ],
)
def test_the_probe_is_in_the_only_package(
    toy: Workspace, packages: str, package: str | None, names: tuple[str, ...]
) -> None:
    """With several packages or a plain module, the probe is outside the packages."""
    path = toy.library / "targets" / "toy.yaml"
    text = path.read_text().replace("package: toycar", packages)
    path.write_text(text.replace('"toycar/**/*.py"', '"**/*.py"'))
    root = toy.library.parent / "target"
    (root / "drive.py").write_text("x = 1\n")
    manifest = toy.manifest("toy")
    assert (manifest.probe_package, manifest.import_names) == (package, names)
    assert "drive.py" in manifest.tree.files
    (root / "drive.py").unlink()
    if "drive" in names:
        with pytest.raises(MutatorError, match=r"no module 'drive.py' under .*correct `root`, `package`"):
            _ = toy.manifest("toy").tree


def test_without_files_the_tree_has_all_files_of_the_packages(toy: Workspace) -> None:
    path = toy.library / "targets" / "toy.yaml"
    lines = path.read_text().replace("package: toycar", "packages: [toycar, drive.py]").splitlines()
    path.write_text("\n".join(line for line in lines if not line.startswith("files:")))
    root = toy.library.parent / "target"
    (root / "toycar" / "deep").mkdir()
    for name in ("drive.py", "other.py", "toycar/deep/x.py", "toycar/deep/x.txt"):
        (root / name).write_text("x = 1\n")
    found = {name for name in toy.manifest("toy").tree.files if not name.startswith("toycar/")}
    assert found == {"drive.py"}
    wanted = {"toycar/deep/x.py", "toycar/deep/x.txt", "toycar/world.py"}
    assert wanted <= toy.manifest("toy").tree.files.keys()


@pytest.mark.parametrize(
    ("packages", "said"),
    [
        ("packages: [toycar, toycar.py]", "4: 'toycar.py'; expected a package, or a module's file"),
        ("packages: [a/b.py]", "4: 'a/b.py'; expected a package, or a module's file"),
        ("packages: [toycar, _fi.py]", "4: '_fi.py'; expected a package, or a module's file"),
        (
            "packages: []",
            "4: []: the target has no package and no module, so nothing of it could be imported",
        ),
        ("about: none", "neither `package` nor `packages`; expected one of them"),
        ("package: toycar\npackages: [toycar]", "5: both `package` and `packages`; expected one of them"),
    ],
)
def test_invalid_packages_are_refused(toy: Workspace, packages: str, said: str) -> None:
    path = toy.library / "targets" / "toy.yaml"
    path.write_text(path.read_text().replace("package: toycar", packages))
    with pytest.raises(MutatorError) as caught:
        toy.manifest("toy")
    assert said in str(caught.value).replace(f"{path}:", "")


def test_a_package_without_files_is_refused(toy: Workspace) -> None:
    path = toy.library / "targets" / "toy.yaml"
    path.write_text(path.read_text().replace("package: toycar", "package: other"))
    with pytest.raises(MutatorError, match="no file of package 'other'"):
        _ = toy.manifest("toy").tree


@pytest.mark.parametrize(
    ("glob", "hits"),
    [
        ("a/*.py", {"a/x.py"}),
        ("a/**/*.py", {"a/x.py", "a/b/y.py", "a/b/c/z.py"}),
        ("**/*.py", {"a/x.py", "a/b/y.py", "a/b/c/z.py", "w.py"}),
        ("a/b/**", {"a/b/y.py", "a/b/c/z.py", "a/b/d.dbc"}),
        ("?.py", {"w.py"}),
        ("a/x.py", {"a/x.py"}),
        ("a/b", set()),
    ],
)
def test_globs_match_the_whole_path(glob: str, hits: set[str]) -> None:
    paths = ["a/x.py", "a/b/y.py", "a/b/c/z.py", "a/b/d.dbc", "w.py", "a/xXpy"]
    assert {p for p in paths if matches_any_glob(p, [glob])} == hits


def test_linked_files_are_part_of_the_tree(toy: Workspace) -> None:
    outside = toy.manifest("toy").root / "outside"
    outside.mkdir()
    root = toy.manifest("toy").root / "toycar"
    (root / "sensor.py").rename(outside / "sensor.py")
    (root / "linked").symlink_to(outside)
    (root / "sensor.py").symlink_to(outside / "sensor.py")
    (outside / "back").symlink_to(outside)
    manifest = toy.manifest("toy")
    assert {"toycar/sensor.py", "toycar/linked/sensor.py"} <= manifest.tree.files.keys()
    assert not any("back" in path for path in manifest.tree.files)
    before = (outside / "sensor.py").read_bytes()
    spec = toy.library / "faults" / "sensor" / "distance.yaml"
    spec.write_text(spec.read_text().replace("toycar/sensor.py", "toycar/linked/sensor.py"))
    (fault, *_) = expand_spec(toy.spec(spec), 0, models=toy.fault_models(), manifest=manifest)
    assert "toycar/linked/sensor.py" in build(manifest, toy.fault_models(), fault, always_trigger()).files
    assert (outside / "sensor.py").read_bytes() == before


def test_a_dangling_link_is_reported_with_its_target(toy: Workspace) -> None:
    link = toy.manifest("toy").root / "toycar" / "glue.py"
    link.symlink_to("nowhere.py")
    with pytest.raises(MutatorError, match=r"toycar/glue.py: a link to nowhere.py, which does not exist"):
        _ = toy.manifest("toy").tree


@pytest.mark.parametrize("end", ["notes.py", "folder", "nowhere"])
def test_a_link_out_of_the_root_is_refused_where_the_tree_would_contain_it(
    toy: Workspace, tmp_path: Path, end: str
) -> None:
    mine = tmp_path / "mine"
    (mine / "folder").mkdir(parents=True)
    for place in (mine, mine / "folder"):
        (place / "notes.py").write_text("secret = 1\n")
    root = toy.manifest("toy").root
    (root / "data").symlink_to(mine / end)  # no glob matches it or anything below it
    before = toy.manifest("toy").tree.digest
    link = root / "toycar" / ("linked" if end == "folder" else "linked.py")
    link.symlink_to(mine / end)
    with pytest.raises(UnsafePath, match=rf"{link}: a link that leads out of its folder") as caught:
        _ = toy.manifest("toy").tree
    assert "secret" not in str(caught.value)
    link.unlink()
    assert toy.manifest("toy").tree.digest == before


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("name: toy\n", 'name: "../../toy"\n', 2),
        ("name: toy\n", 'name: "a\\u202eb"\n', 2),
        ("toycar/**/*.py", "../**", 5),
        ("toycar/**/*.py", "/etc/host*", 5),
        ("toycar/judge.py", "../x.py", 6),
        ("package: toycar\n", 'package: toycar\noverlay: "../../.."\n', 5),
        ("package: toycar\n", "package: toycar\noverlay: /usr\n", 5),
        ("package: toycar\n", 'package: "toycar\\0"\n', 4),
        ("{alone: ", '{"/../../x": [], alone: ', 11),
        ("{alone: ", "{..: [], alone: ", 11),
    ],
)
def test_names_that_lead_out_are_refused_at_their_line(toy: Workspace, old: str, new: str, line: int) -> None:
    path = toy.library / "targets" / "toy.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(MutatorError) as caught:
        _ = toy.manifest("toy").tree
    assert caught.value.where == str(path)
    assert caught.value.line == line


def test_digests_do_not_depend_on_order(tmp_path: Path) -> None:
    for name, order in (("a", ["x.py", "y.py"]), ("b", ["y.py", "x.py"])):
        (tmp_path / name).mkdir()
        for file in order:
            (tmp_path / name / file).write_text(file)
    assert read_tree(tmp_path / "a", ["*.py"]).digest == read_tree(tmp_path / "b", ["*.py"]).digest
