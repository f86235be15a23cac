"""The location, the content and the deletion order of caches."""

import os
from pathlib import Path

import pytest

from mutator._common import cache_layout_and_pruning


@pytest.fixture
def filled() -> Path:
    """A cache with three files of a target, used one after another, and checks that were used last."""
    checks = cache_layout_and_pruning.cached_checks_folder() / "ab12" / "golden" / "A"
    checks.mkdir(parents=True)
    (checks / "trace.npz").write_bytes(b"1" * 5000)
    (checks.parents[1] / "checks.json").write_bytes(b"2")
    compiled = cache_layout_and_pruning.target_cache_folder("car") / "compiled"
    compiled.mkdir(parents=True)
    for used, path in enumerate((compiled / "hog.so", compiled.parent / "b.npy", compiled.parent / "a.npy")):
        path.write_bytes(b"3" * 9000)
        os.utime(path, (1000 + used, 1000 + used))
    return cache_layout_and_pruning.caches_folder()


@pytest.mark.parametrize("named", ["", "relative/folder"])
def test_the_cache_is_in_the_home_folder_unless_xdg_cache_home_is_absolute(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: str
) -> None:
    """The XDG specification requires an absolute path."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_layout_and_pruning.caches_folder() == tmp_path / "mutator"
    monkeypatch.setenv("XDG_CACHE_HOME", named)
    assert cache_layout_and_pruning.caches_folder() == tmp_path / "home" / ".cache" / "mutator"


def test_without_a_home_folder_the_cache_is_empty(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", no_home)
    with pytest.raises(OSError):
        cache_layout_and_pruning.target_cache_folder("car").mkdir(parents=True)
    assert (
        cache_layout_and_pruning.list_entries(),
        cache_layout_and_pruning.prune_cache(0),
        cache_layout_and_pruning.clear_cache(),
    ) == (
        [],
        [],
        [],
    )


@pytest.mark.parametrize("name", ["..", "a/b", "/", ".hidden", "plain", "ä" * 100])
def test_any_target_name_gives_a_folder_directly_below_targets(name: str) -> None:
    place = cache_layout_and_pruning.target_cache_folder(name)
    assert place.resolve().parent == (cache_layout_and_pruning.caches_folder() / "targets").resolve()
    place.mkdir(parents=True)
    assert cache_layout_and_pruning.prune_target_cache(name) == []


def test_checks_form_one_entry_and_each_target_file_has_its_own(filled: Path) -> None:
    found = [
        (entry.what, entry.path.relative_to(filled).as_posix())
        for entry in cache_layout_and_pruning.list_entries()
    ]
    files = ["targets/car/a.npy", "targets/car/b.npy", "targets/car/compiled/hog.so"]
    assert found == [("checks", "checks/ab12"), *(("target car", file) for file in files)]
    assert all(entry.size >= 5000 for entry in cache_layout_and_pruning.list_entries())


def test_the_size_of_a_sparse_file_is_its_size_on_disk() -> None:
    place = cache_layout_and_pruning.target_cache_folder("car")
    place.mkdir(parents=True)
    with (place / "table").open("wb") as file:
        file.truncate(800_000_000)
    [entry] = cache_layout_and_pruning.list_entries()
    assert entry.size < 1_000_000


def test_pruning_deletes_the_least_recently_used_entries_first(filled: Path) -> None:
    sizes = {entry.path.name: entry.size for entry in cache_layout_and_pruning.list_entries()}
    kept = sizes["ab12"] + sizes["a.npy"]
    assert [entry.path.name for entry in cache_layout_and_pruning.prune_cache(kept)] == ["hog.so", "b.npy"]
    assert [entry.path.name for entry in cache_layout_and_pruning.list_entries()] == ["ab12", "a.npy"]
    assert cache_layout_and_pruning.prune_cache(kept) == []


def test_clearing_deletes_links_but_not_their_targets(filled: Path) -> None:
    outside = filled.parent / "outside"
    outside.mkdir()
    (outside / "kept").write_text("kept")
    (filled / "targets" / "car" / "link").symlink_to(outside)
    assert len(cache_layout_and_pruning.clear_cache()) == 5
    assert [path for path in filled.rglob("*") if path.is_file()] == []
    assert (outside / "kept").exists()


def test_making_room_deletes_the_least_recently_used_files_of_a_target(
    filled: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cache_layout_and_pruning.prune_target_cache("car") == []
    monkeypatch.setattr(cache_layout_and_pruning, "MOST_TARGET_CACHE_BYTES", 2 * 12_288)
    assert [entry.path.name for entry in cache_layout_and_pruning.prune_target_cache("car")] == ["hog.so"]
    assert cache_layout_and_pruning.prune_target_cache("truck") == []
    assert len(cache_layout_and_pruning.list_entries()) == 3
