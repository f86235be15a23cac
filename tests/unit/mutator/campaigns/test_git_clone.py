"""What git knows about a folder, and that a clone's own configuration runs no program."""

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.campaigns import git_clone
from mutator.campaigns.git_clone import GitClone, find_clone_state, find_user_name
from mutator.store.session_environments import GitCloneState

IDENTITY = ("-c", "user.name=x", "-c", "user.email=x@example.org", "-c", "commit.gpgsign=false")


def git(folder: Path, *words: str) -> str:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    command = ["git", "-C", folder, *IDENTITY, *words]
    return subprocess.run(command, env=clean, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A clone with a library in it."""
    root = tmp_path / "clone"
    (root / "library/faults").mkdir(parents=True)
    for name in ("a.yaml", "b.yaml", "faults/c.yaml"):
        (root / "library" / name).write_text(name)
    (root / "library/link").symlink_to("a.yaml")
    (root / ".gitignore").write_text("*.pyc\nbuild/\n")
    (root / "other.txt").write_text("other")
    git(root, "init", "-q")
    commit(root)
    return root


def commit(root: Path) -> None:
    git(root, "add", ".")
    git(root, "commit", "-qm", "more")


def test_only_changes_in_the_folder_itself_make_a_commit_dirty(tmp_path: Path) -> None:
    library, other = tmp_path / "library", tmp_path / "other"
    for folder in (library, other):
        folder.mkdir()
        (folder / "a.yaml").write_text("a")
    assert find_clone_state(library) is None
    git(tmp_path, "init", "-q")
    assert find_clone_state(library) is None  # no commit yet
    git(tmp_path, "add", "library")
    git(tmp_path, "commit", "-qm", "one")
    found = find_clone_state(library)
    assert found is not None and len(found.commit) == 40 and not found.changed
    assert find_clone_state(other) is None  # inside the clone, but not in any commit
    (library / "b.yaml").write_text("new")
    assert find_clone_state(library) == replace(found, changed=True)


def test_without_git_there_is_no_commit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_clone_state(Path(__file__).parent) is None


CHANGES: dict[str, Callable[[Path], object]] = {
    "nothing": lambda lib: None,
    "touched": lambda lib: os.utime(lib / "a.yaml"),
    "edited": lambda lib: (lib / "a.yaml").write_text("A.yaml"),
    "longer": lambda lib: (lib / "faults/c.yaml").write_text("more"),
    "deleted": lambda lib: (lib / "b.yaml").unlink(),
    "folder deleted": lambda lib: shutil.rmtree(lib / "faults"),
    "new": lambda lib: (lib / "faults/d.yaml").write_text("d"),
    "new in a new folder": lambda lib: write(lib / "x/y/z.yaml"),
    "new with odd name": lambda lib: write(lib / ":(top)é\n\t'.yaml"),
    "empty folder": lambda lib: (lib / "x/y").mkdir(parents=True),
    "ignored": lambda lib: write(lib / "faults/__pycache__/d.pyc"),
    "ignored folder": lambda lib: write(lib / "build/d.txt"),
    "ignored and not": lambda lib: (write(lib / "x/d.pyc"), write(lib / "x/e.txt")),
    "excluded": lambda lib: ((lib / "../.git/info/exclude").write_text("*.tmp\n"), write(lib / "d.tmp")),
    "excluded by the user": lambda lib: write(lib / "d.mine"),
    "ignored by its own file": lambda lib: ((lib / "x").mkdir(), (lib / "x/.gitignore").write_text("*\n")),
    "elsewhere": lambda lib: (lib / "../other.txt").write_text("changed"),
    "link turned": lambda lib: ((lib / "link").unlink(), (lib / "link").symlink_to("b.yaml")),
    "link for a file": lambda lib: ((lib / "b.yaml").unlink(), (lib / "b.yaml").symlink_to("a.yaml")),
    "folder for a file": lambda lib: ((lib / "b.yaml").unlink(), write(lib / "b.yaml/c")),
    "pipe": lambda lib: os.mkfifo(lib / "pipe"),
    "pipe for a file": lambda lib: ((lib / "b.yaml").unlink(), os.mkfifo(lib / "b.yaml")),
    "new link": lambda lib: (lib / "new").symlink_to("/nowhere"),
}


def write(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("new")


@pytest.mark.parametrize("change", CHANGES)
def test_changes_are_those_that_git_status_lists(
    clone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    (tmp_path / "config/git").mkdir(parents=True)
    (tmp_path / "config/git/ignore").write_text("*.mine\n")
    library = clone / "library"
    CHANGES[change](library)
    state = find_clone_state(library)
    expected = bool(git(library, "status", "--porcelain", "--", "."))
    assert state == GitCloneState(commit=git(clone, "rev-parse", "HEAD").strip(), changed=expected)


@pytest.mark.parametrize("hash_name", ["sha1", "sha256"])
def test_worktrees_shallow_clones_and_submodules_are_clones(tmp_path: Path, hash_name: str) -> None:
    root = tmp_path / "root"
    write(root / "library/a.yaml")
    git(root, "init", "-q", f"--object-format={hash_name}")
    commit(root)
    write(root / "library/b.yaml")
    commit(root)
    git(root, "worktree", "add", "-q", str(tmp_path / "tree"), "-b", "side")
    git(tmp_path, "clone", "-q", "--depth=1", f"file://{root}", "shallow")
    outer = tmp_path / "outer"
    outer.mkdir()
    git(outer, "init", "-q", f"--object-format={hash_name}")
    git(outer, "-c", "protocol.file.allow=always", "submodule", "add", "-q", str(root), "inner")
    git(outer, "commit", "-qm", "inner")
    for top in (tmp_path / "tree", tmp_path / "shallow", outer / "inner"):
        library = top / "library"
        state = find_clone_state(library)
        assert state == GitCloneState(commit=git(root, "rev-parse", "HEAD").strip(), changed=False)
        found = GitClone.find(library)
        assert found is not None and found.hash_name == hash_name
        assert found.describe_last_change([library / "b.yaml"], "--format=%H") == state.commit + "\n"
    whole = find_clone_state(outer)
    assert whole is not None and not whole.changed


def test_a_file_that_git_converts_counts_as_changed(clone: Path) -> None:
    """The bytes that a run reads are not those of the commit."""
    (clone / ".gitattributes").write_text("* text eol=crlf\n")
    (clone / "library/a.yaml").write_bytes(b"a\r\n")
    commit(clone)
    assert git(clone, "status", "--porcelain") == ""
    state = find_clone_state(clone / "library")
    assert state is not None and state.changed


@pytest.mark.slow
def test_ten_thousand_files_take_a_second(tmp_path: Path) -> None:
    for folder in range(100):
        (tmp_path / f"{folder}").mkdir()
        for name in range(100):
            (tmp_path / f"{folder}" / f"{name}.py").write_text(f"x = {name}\n" * 50)
    git(tmp_path, "init", "-q")
    commit(tmp_path)
    began = time.process_time()
    state = find_clone_state(tmp_path)
    assert state is not None and not state.changed
    assert time.process_time() - began < 3


def test_git_that_does_not_answer_is_not_waited_for(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(git_clone, "_MOST_GIT_TIME_S", 0.2)
    (clone / ".git/HEAD").unlink()
    os.mkfifo(clone / ".git/HEAD")
    assert find_clone_state(clone) is None


def test_a_commit_with_more_files_than_memory_is_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tree that holds one tree ten times, ten levels deep, lists ten billion files."""
    git(tmp_path, "init", "-q")
    (tmp_path / "file").write_text("x")
    mode, kind, inner = "100644", "blob", git(tmp_path, "hash-object", "-w", "file").strip()
    for _ in range(10):
        lines = "".join(f"{mode} {kind} {inner}\t{number}\n" for number in range(10))
        made = subprocess.run(
            ["git", "-C", tmp_path, "mktree"], input=lines, capture_output=True, text=True, check=True
        )
        mode, kind, inner = "040000", "tree", made.stdout.strip()
    git(tmp_path, "update-ref", "HEAD", git(tmp_path, "commit-tree", inner, "-m", "bomb").strip())
    monkeypatch.setattr(git_clone, "_MOST_OUTPUT_BYTES", 1 << 20)
    assert find_clone_state(tmp_path) is None


def plant_fsmonitor(root: Path, run: str) -> None:
    git(root, "config", "core.fsmonitor", run)


def plant_filters(root: Path, run: str) -> None:
    for name in ("clean", "smudge", "process"):
        git(root, "config", f"filter.evil.{name}", run)
    (root / ".gitattributes").write_text("* filter=evil\n")
    (root / "library/a.yaml").write_text("A.yaml")


def plant_hooks(root: Path, run: str) -> None:
    (root / "hooks").mkdir()
    names = (
        "post-index-change",
        "pre-auto-gc",
        "post-checkout",
        "reference-transaction",
        "fsmonitor-watchman",
    )
    for name in names:
        (root / "hooks" / name).write_text(f"#!/bin/sh\n{run}\n")
        (root / "hooks" / name).chmod(0o755)
    git(root, "config", "core.hooksPath", str(root / "hooks"))
    os.utime(root / "library/a.yaml", (1, 1))


def plant_signature(root: Path, run: str) -> None:
    text = git(root, "cat-file", "commit", "HEAD")
    head, _, message = text.partition("\n\n")
    signed = f"{head}\ngpgsig -----BEGIN PGP SIGNATURE-----\n x\n -----END PGP SIGNATURE-----\n\n{message}"
    (root / "signed").write_text(signed)
    git(root, "update-ref", "HEAD", git(root, "hash-object", "-t", "commit", "-w", "signed").strip())
    git(root, "config", "log.showSignature", "true")
    for name in ("gpg.program", "gpg.openpgp.program", "gpg.ssh.program", "gpg.x509.program"):
        git(root, "config", name, run)


def plant_promisor(root: Path, run: str) -> None:
    git(root, "config", "core.repositoryFormatVersion", "1")
    git(root, "config", "extensions.partialClone", "evil")
    git(root, "config", "remote.evil.promisor", "true")
    git(root, "config", "remote.evil.url", f"ext::{run}")
    git(root, "config", "remote.evil.uploadpack", run)
    git(root, "config", "remote.evil.vcs", "ext")
    git(root, "config", "protocol.allow", "always")
    git(root, "config", "core.sshCommand", run)
    for path in list((root / ".git/objects").glob("??/*")):
        if path.parent.name + path.name != git(root, "rev-parse", "HEAD").strip():
            path.unlink()


def plant_include(root: Path, run: str) -> None:
    (root / "more").write_text(f"[core]\n\tfsmonitor = {run}\n")
    git(root, "config", "include.path", str(root / "more"))


def plant_programs(root: Path, run: str) -> None:
    more = ("pager", "editor", "askPass", "gitProxy", "alternateRefsCommand", "sshCommand")
    names = [f"core.{name}" for name in more]
    names += ["credential.helper", "diff.external", "diff.evil.textconv", "diff.evil.command"]
    names += ["alias.status", "alias.log", "alias.rev-parse", "alias.config", "pager.log", "pager.rev-parse"]
    names += ["uploadpack.packObjectsHook", "sequence.editor", "interactive.diffFilter", "merge.evil.driver"]
    for name in names:
        git(root, "config", name, f"!{run}" if name.startswith("alias") else run)
    (root / ".gitattributes").write_text("* diff=evil merge=evil\n")
    (root / "library/a.yaml").write_text("A.yaml")


def plant_bare(root: Path, run: str) -> None:
    """The library itself looks like a repository of its own."""
    for name in ("HEAD", "config", "objects", "refs", "index"):
        (root / ".git" / name).rename(root / "library" / name)
    shutil.rmtree(root / ".git")
    for name in ("bare", "worktree", "fsmonitor"):
        value = {"bare": "false", "worktree": str(root / "library"), "fsmonitor": run}[name]
        subprocess.run(["git", "config", "-f", root / "library/config", f"core.{name}", value], check=True)


PLANTS = [value for name, value in dict(globals()).items() if name.startswith("plant_")]


@pytest.mark.parametrize("plant", PLANTS)
def test_a_clones_configuration_runs_no_program(
    clone: Path, tmp_path: Path, plant: Callable[[Path, str], None]
) -> None:
    script = tmp_path / "evil"
    script.write_text(f"#!/bin/sh\necho $0 $* >> {tmp_path}/ran\n")
    script.chmod(0o755)
    plant(clone, str(script))
    library = clone / "library"
    find_clone_state(library)
    find_user_name(library)
    found = GitClone.find(library)
    assert (found is None) == (plant is plant_bare)
    if found:
        found.differs_from_commit(library, leave_out="reviews")
        found.find_changed([library / "a.yaml"])
        found.describe_last_change([library / "a.yaml"], "--format=%H%n%an")
    assert not (tmp_path / "ran").exists(), (tmp_path / "ran").read_text()
