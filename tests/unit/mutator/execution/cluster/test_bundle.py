"""A bundle contains only files of the library and the target, and is written only into its own folder."""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from mutator.errors import MutatorError, UnsafePath
from mutator.execution.cluster import bundle
from mutator.execution.cluster.bundle import Bundle, load_run_inputs, unpack_bundle, unpack_growth
from mutator.execution.cluster.packed_bytes import pack_parcel, unpack_parcel
from mutator.execution.cluster.unpacked_bundle import UnpackedBundle
from mutator.execution.frozen_plan import open_or_freeze_run
from mutator.execution.session_opening import open_session
from mutator.limits import MeasuredLimits
from mutator.store.checks_file import CHECKS_FILE
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

Prepared = tuple[Workspace, RunFolder]


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    """A folder with the toy, and a run of its small campaign that has passed its checks."""
    folder = tmp_path_factory.mktemp("checked")
    toy = copy_toycar(folder / "home" / "lib")
    run = folder / "home" / "run"
    open_run = partial(open_or_freeze_run, toy, "small", run, Choices(), reviewed=False)
    with open_session(toy, open_run, run, workers=1, engine="reference") as session:
        session.prepare()
    return folder / "home"


@pytest.fixture
def prepared(checked: Path, tmp_path: Path) -> Prepared:
    shutil.copytree(checked, tmp_path / "home", symlinks=True)
    home = tmp_path / "home"
    (home / "notes.txt").write_text("my secret")
    [library] = home.glob("lib/**/fault_library")
    return Workspace(library=library, templates=library.parent / "templates"), RunFolder.open(home / "run")


@pytest.mark.parametrize("measured", [None, {"cpu_s": 20, "wall_s": 300}])
def test_a_worker_has_the_limits_of_the_run(
    prepared: Prepared, tmp_path: Path, measured: dict[str, int] | None
) -> None:
    """They are the campaign's, or those that the command measured, never the worker's own measurement."""
    workspace, folder = prepared
    if measured:
        checks = json.loads((folder.path / CHECKS_FILE).read_text()) | {"measured_limits": measured}
        (folder.path / CHECKS_FILE).write_text(json.dumps(checks))
    unpack_bundle(Bundle.pack_for_run(workspace, folder, "reference").data, tmp_path / "worker")
    assert UnpackedBundle(tmp_path / "worker").limits == folder.limits
    assert isinstance(folder.limits, MeasuredLimits) == bool(measured)


def test_growth_brings_golden_runs_and_scenarios_and_nothing_else(prepared: Prepared, tmp_path: Path) -> None:
    """A bundle that has grown has the bytes of one packed now; what is not part of growth is refused, and a
    link that a mutant put in the way is not followed.
    """
    workspace, folder = prepared
    site, whole = tmp_path / "site", Bundle.pack_for_run(workspace, folder, "reference")
    unpack_bundle(whole.data, site)
    shutil.rmtree(site / "scenarios")
    (site / "meta.json").write_text("{}")
    growth = Bundle.pack_growth(workspace, folder, "reference")
    unpack_growth(growth.data, site)
    parts = unpack_parcel(growth.data)
    assert {*parts} == {"meta.json", "scenarios/A.yaml"}
    for name, content in unpack_parcel(whole.data).items():
        assert (site / name).read_bytes() == content
    with pytest.raises(UnsafePath, match=r"templates/offset\.j2"):
        unpack_growth(pack_parcel(parts | {"templates/offset.j2": b""}), site)
    shutil.rmtree(site / "scenarios")
    (site / "scenarios").symlink_to(tmp_path)
    with pytest.raises(UnsafePath):
        unpack_growth(growth.data, site)
    assert not (tmp_path / "A.yaml").exists()


def with_argument(workspace: Workspace, text: str) -> None:
    path = workspace.library / "targets" / "toycar.yaml"
    old = 'args: ["{scenario}", '
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, f"{old}{json.dumps(text)}, "))


def test_a_bundle_has_the_tree_the_templates_and_what_arguments_name(prepared: Prepared) -> None:
    workspace, folder = prepared
    root = workspace.manifest("toycar").root
    (root / "data").mkdir()
    (root / "data" / "map.npz").write_bytes(b"road")
    (root / "data" / "linked.npz").symlink_to("map.npz")
    (root / "other.txt").write_text("not named")
    (workspace.templates / ".env").write_text("TOKEN=1")
    with_argument(workspace, "{root}/data")
    parts = unpack_parcel(Bundle.pack_for_run(workspace, folder, "reference").data)
    tree = workspace.manifest("toycar").tree
    assert {name for name in parts if name.startswith("target/")} == {
        *(f"target/{name}" for name in tree.files),
        "target/data/map.npz",
        "target/data/linked.npz",
    }
    assert parts["target/data/linked.npz"] == b"road"
    assert {Path(name).suffix for name in parts if name.startswith("templates/")} == {".yaml", ".j2"}


@pytest.mark.parametrize(
    "argument",
    [
        "{root}/../../../notes.txt",
        "{root}//etc/hostname",
        "{root}/",
        "{root}/.",
        "{root}/x/../../..",
        "{root}/link",
        "{root}/data",
    ],
)
def test_a_file_outside_the_root_is_not_packed(prepared: Prepared, argument: str) -> None:
    workspace, folder = prepared
    root = workspace.manifest("toycar").root
    notes = folder.path.parent / "notes.txt"
    (root / "link").symlink_to(notes)
    (root / "data").mkdir()
    (root / "data" / "link").symlink_to(notes.parent)
    (root / "data" / "more").symlink_to(notes)
    with_argument(workspace, argument)
    with pytest.raises(MutatorError, match=r"toycar\.yaml:\d+: ") as caught:
        Bundle.pack_for_run(workspace, folder, "reference")
    assert "secret" not in str(caught.value)


def test_a_linked_template_is_not_packed(prepared: Prepared) -> None:
    workspace, folder = prepared
    (workspace.templates / "more.py.j2").symlink_to(folder.path.parent / "notes.txt")
    with pytest.raises(MutatorError, match="a link that leads out of its folder"):
        Bundle.pack_for_run(workspace, folder, "reference")


def test_two_names_that_differ_only_in_case_are_refused(prepared: Prepared) -> None:
    workspace, folder = prepared
    root = workspace.manifest("toycar").root
    for name in ("Map.npz", "map.npz"):
        (root / "data").mkdir(exist_ok=True)
        (root / "data" / name).write_bytes(b"1")
    with_argument(workspace, "{root}/data")
    with pytest.raises(MutatorError, match=r"target/data/Map\.npz and target/data/map\.npz"):
        Bundle.pack_for_run(workspace, folder, "reference")


def test_a_huge_file_is_refused_unread(prepared: Prepared) -> None:
    workspace, folder = prepared
    data = workspace.manifest("toycar").root / "data"
    data.touch()
    os.truncate(data, 4_000_000_000_000)
    with_argument(workspace, "{root}/data")
    with pytest.raises(MutatorError, match=r"data: 4000\.0 GB for each worker .* expected at most 2 GB"):
        Bundle.pack_for_run(workspace, folder, "reference")


def names_below(folder: Path) -> Iterator[str]:
    return (path.relative_to(folder).as_posix() for path in folder.rglob("*"))


@pytest.mark.parametrize(
    "name",
    [
        "../x",
        "target/../../x",
        "/tmp/x",
        "target//x",
        "target/./x",
        "x",
        "target",
        "other/x",
        "",
        "target/a\0b",
        "target/a\nb",
        "meta.json/x",
        "target/\ud800",
        "target/" + "a" * 300,
        "Target/x",
    ],
)
def test_a_bundle_that_arrives_with_another_name_is_not_written(tmp_path: Path, name: str) -> None:
    place = tmp_path / "work" / "place"
    place.mkdir(parents=True)
    with pytest.raises(MutatorError):
        unpack_bundle(pack_parcel({"meta.json": b"{}", name: b"x"}), place)
    assert list(names_below(tmp_path)) == ["work", "work/place"]


@pytest.mark.parametrize(
    "parts", [{"target/a": b"", "target/A": b""}, {"target/a": b"x" * 10}], ids=["case", "size"]
)
def test_a_bundle_that_no_command_packs_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parts: dict[str, bytes]
) -> None:
    monkeypatch.setattr(bundle, "MOST_BUNDLE_BYTES", 5)
    with pytest.raises(MutatorError):
        unpack_bundle(pack_parcel(parts), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("manifest", "../../notes.yaml"),
        ("manifest", "/etc/hostname"),
        ("manifest", None),
        ("manifest", "a/b.yaml"),
        ("limits", {"no": 1}),
        ("limits", None),
        ("goldens", [1]),
        ("goldens", None),
        ("goldens", [{"golden": ["/tmp/x", []], "digest": ""}]),
        ("goldens", [{"golden": ["S1", ["/../../x"]], "digest": ""}]),
        ("goldens", [{"golden": ["S1", [1]], "digest": ""}]),
    ],
)
def test_a_description_that_names_other_files_is_refused(
    prepared: Prepared, tmp_path: Path, key: str, value: object
) -> None:
    data = unpack_parcel(Bundle.pack_for_run(*prepared, "reference").data)
    data["meta.json"] = json.dumps(json.loads(data["meta.json"]) | {key: value}).encode()
    place = tmp_path / "place"
    place.mkdir()
    unpack_bundle(pack_parcel(data), place)
    with pytest.raises(MutatorError, match=r"meta\.json"):
        load_run_inputs(UnpackedBundle(place))
    with pytest.raises(MutatorError):
        UnpackedBundle(place).scenario_path("../../notes")
