"""Files are reached only by plain names, and only below their folder."""

import os
from pathlib import Path

import pytest

from mutator._common.confined_files import (
    check_only_plain_files,
    checked_name_not_path,
    checked_relative_path,
    entries_below,
    move_below,
    move_plain_files,
    open_below,
    open_folder,
    read_below,
    unlink_below,
    write_below,
)
from mutator.errors import UnsafePath

OUTSIDE = [
    "",
    "..",
    "../a",
    "a/../b",
    "/etc/passwd",
    "a//b",
    "./a",
    "a/",
    "a\0b",
    "a\nb",
    "\u202ea",
    "\udcff",
    "x" * 300,
]


@pytest.mark.parametrize("name", [*OUTSIDE, None, 3, ["a"]], ids=ascii)
def test_a_name_that_leads_outside_is_refused(name: object, tmp_path: Path) -> None:
    with pytest.raises(UnsafePath, match="the name"):
        checked_relative_path(name, tmp_path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    inside = tmp_path / "folder"
    (inside / "a").mkdir(parents=True)
    (inside / "a" / "b.txt").write_bytes(b"inside")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "b.txt").write_bytes(b"secret")
    return inside


def test_a_file_is_read(folder: Path) -> None:
    assert read_below(folder, "a/b.txt") == b"inside"


def test_the_root_may_be_a_link(folder: Path) -> None:
    link = folder.with_name("link")
    link.symlink_to(folder)
    assert read_below(link, "a/b.txt") == b"inside"


def test_a_missing_file_is_missing(folder: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_below(folder, "a/c.txt")
    unlink_below(folder, "a/c.txt")
    unlink_below(folder, "c/c.txt")


@pytest.mark.parametrize("kind", ["link", "dangling", "pipe", "folder"])
def test_only_a_regular_file_is_opened(folder: Path, kind: str) -> None:
    place = folder / "x"
    match kind:
        case "link":
            place.symlink_to(folder / "a" / "b.txt")
        case "dangling":
            place.symlink_to(folder / "nothing")
        case "pipe":
            os.mkfifo(place)
        case "folder":
            place.mkdir()
    with pytest.raises(UnsafePath, match="x: a link, a pipe"):
        open_below(folder, "x")


def test_a_linked_folder_is_not_entered(folder: Path) -> None:
    (folder / "c").symlink_to(folder.parent / "elsewhere")
    for reach in (read_below, unlink_below, lambda root, name: write_below(root, name, b"new")):
        with pytest.raises(UnsafePath):
            reach(folder, "c/b.txt")
    assert (folder.parent / "elsewhere" / "b.txt").read_bytes() == b"secret"


def test_a_file_is_written_with_its_folders(folder: Path) -> None:
    write_below(folder, "d/e/f.txt", b"new")
    assert (folder / "d" / "e" / "f.txt").read_bytes() == b"new"
    assert [path.name for path in (folder / "d" / "e").iterdir()] == ["f.txt"]


def test_a_link_is_replaced_and_not_written_through(folder: Path) -> None:
    (folder / "x").symlink_to(folder.parent / "elsewhere" / "b.txt")
    write_below(folder, "x", b"new")
    assert not (folder / "x").is_symlink()
    assert (folder.parent / "elsewhere" / "b.txt").read_bytes() == b"secret"


def test_a_link_is_deleted_and_not_followed(folder: Path) -> None:
    (folder / "x").symlink_to(folder.parent / "elsewhere" / "b.txt")
    unlink_below(folder, "x")
    assert not os.path.lexists(folder / "x")
    assert (folder.parent / "elsewhere" / "b.txt").exists()


def test_a_folder_of_files_is_plain(folder: Path) -> None:
    check_only_plain_files(folder)


@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_a_folder_with_anything_else_is_not_plain(folder: Path, kind: str) -> None:
    place = folder / "a" / "x"
    if kind == "link":
        place.symlink_to(folder.parent)
    else:
        os.mkfifo(place)
    with pytest.raises(UnsafePath, match="a/x: a link, a pipe"):
        check_only_plain_files(folder)


def moved(source: Path, target: Path) -> None:
    target.mkdir()
    with open_folder(source) as one, open_folder(target) as other:
        move_plain_files(one, other)


def test_only_plain_files_are_moved(folder: Path) -> None:
    (folder / "a" / "link").symlink_to(folder / "a" / "b.txt")
    (folder / "links").symlink_to(folder / "a")
    (folder / "a" / "c\n").mkdir()
    (folder / "a" / "c\n" / "file").touch()
    os.mkfifo(folder / "pipe")
    (folder / "d").joinpath(*"d" * 100).mkdir(parents=True)
    target = folder.parent / "target"
    moved(folder, target)
    assert read_below(target, "a/b.txt") and sum(1 for _ in (target / "d").rglob("*")) < 40
    assert sorted(path.name for path in target.iterdir()) == ["a", "d"]
    assert [path.name for path in (target / "a").iterdir()] == ["b.txt"]


def test_what_is_exchanged_while_it_is_moved_does_not_arrive(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = os.rename

    def exchanging(name: str, to: str, *, src_dir_fd: int, dst_dir_fd: int) -> None:
        os.unlink(name, dir_fd=src_dir_fd)
        os.symlink("/etc/passwd", name, dir_fd=src_dir_fd)
        real(name, to, src_dir_fd=src_dir_fd, dst_dir_fd=dst_dir_fd)

    monkeypatch.setattr(os, "rename", exchanging)
    moved(folder, folder.parent / "target")
    assert [path.name for path in (folder.parent / "target").rglob("*")] == ["a"]


def test_a_move_does_not_follow_links(folder: Path) -> None:
    elsewhere = folder.parent / "elsewhere"
    move_below(folder, "a/b.txt", "d/e.txt")
    assert (folder / "d" / "e.txt").exists()
    (folder / "link").symlink_to(elsewhere)
    move_below(folder, "link", "d/link")
    assert (folder / "d" / "link").is_symlink()
    for name, to in (("d/link/b.txt", "x"), ("d/e.txt", "d/link/x")):
        with pytest.raises(UnsafePath):
            move_below(folder, name, to)
    assert [path.name for path in elsewhere.iterdir()] == ["b.txt"]


def test_a_closed_folder_is_listed_without_its_content(folder: Path) -> None:
    (folder / "link").symlink_to(folder)
    assert {name for name, _ in entries_below(folder, lambda name: name == "a")} == {"a", "link"}


@pytest.mark.parametrize("name", ["S1.yaml", "../S1.yml"])
def test_the_path_of_a_file_is_no_name_in_the_library(name: str) -> None:
    with pytest.raises(UnsafePath, match=r"run\.json: the path .*; expected the name"):
        checked_name_not_path(name, "run.json")
    assert checked_name_not_path("cut_in/S1", "run.json") == "cut_in/S1"
