"""With `four_eyes`, the author of the last change in git cannot approve that change."""

import os
import subprocess
from pathlib import Path

import pytest

from mutator.campaigns.git_clone import find_user_name
from mutator.errors import MutatorError
from mutator.review.commits_and_four_eyes import library_commit
from mutator.review.mutant_groups import Group, groups_of_library
from mutator.review.review_state_and_actions import (
    Review,
    ReviewAction,
    ReviewActionKind,
    ReviewState,
    load_review,
    record_actions,
)
from mutator.workspace import Workspace

HEAD = 'schema: review/2\ntarget: "toycar"\nfour_eyes: true\ndecisions: []\n'
LANE = "fault_library/faults/sensor/lane.yaml"
OFFSET = "templates/offset.py.j2"


def git(folder: Path, *words: str) -> str:
    names = {"AUTHOR_NAME": "Git Smith", "AUTHOR_EMAIL": "smith@example.org"}
    names |= {"COMMITTER_NAME": "A Robot", "COMMITTER_EMAIL": "robot@example.org"}
    env = os.environ | {f"GIT_{name}": value for name, value in names.items()}
    done = subprocess.run(["git", *words], cwd=folder, env=env, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def commit(root: Path, path: str, author: str) -> str:
    with (root / path).open("a") as file:
        file.write("{# more #}\n" if path.endswith("j2") else "# more\n")
    git(root, "commit", "-qam", "more", f"--author={author}")
    return git(root, "rev-parse", "HEAD")


@pytest.fixture
def root(toycar: Workspace) -> Path:
    root = toycar.library.parent
    (root / "fault_library/reviews").mkdir()
    (root / "fault_library/reviews/toycar.yaml").write_text(HEAD)
    for words in (("init", "-q"), ("add", "."), ("commit", "-qm", "all of it")):
        git(root, *words)
    return root


def lane(toy: Workspace) -> Group:
    return groups_of_library(toy, toy.manifest("toycar"), specs=["sensor/lane"])[0]


def say(toy: Workspace, by: str, kind: ReviewActionKind = ReviewActionKind.APPROVE) -> Review:
    group, review = lane(toy), load_review(toy, "toycar")
    return record_actions(
        toy,
        "toycar",
        [ReviewAction(group=group, kind=kind, by=by)],
        {group.id: review.revision(group.id)},
    )


def test_the_last_author_cannot_approve(toycar: Workspace, root: Path) -> None:
    for author in ("Git Smith", "smith@example.org", "git smith <other@example.org>"):
        with pytest.raises(MutatorError, match=r"changed group \w{12} last \(commit .*Git Smith") as caught:
            say(toycar, author)
    assert git(root, "rev-parse", "HEAD")[:12] in str(caught.value)
    assert load_review(toycar, "toycar").entry_by_group == {}
    review = say(toycar, "Jane Doe")
    assert review.state(lane(toycar)) is ReviewState.APPROVED
    assert load_review(toycar, "toycar").four_eyes
    assert say(toycar, "Git Smith", ReviewActionKind.REJECT).state(lane(toycar)) is ReviewState.REJECTED


@pytest.mark.parametrize("path", [LANE, OFFSET, "templates/offset.yaml"])
def test_earlier_authors_can_approve(toycar: Workspace, root: Path, path: str) -> None:
    sha = commit(root, path, "Jane Doe <jane@example.org>")
    commit(root, "fault_library/faults/sensor/distance.yaml", "Joe <joe@example.org>")
    with pytest.raises(MutatorError, match=sha[:12]):
        say(toycar, "Jane Doe")
    assert say(toycar, "Joe").decision(lane(toycar).id)
    assert say(toycar, "Git Smith").decision(lane(toycar).id)


def test_a_co_author_cannot_approve(toycar: Workspace, root: Path) -> None:
    commit(root, LANE, "Joe <joe@example.org>")
    words = "more\n\nCo-authored-by: Jane  Doe <jane@example.org>\nCo-Authored-By: Jim <jim@example.org>"
    git(root, "commit", "-q", "--amend", "-m", words)
    for author in ("Joe", "jane doe", "JANE@example.org", "Jim"):
        with pytest.raises(MutatorError, match=r"by Joe <joe@example\.org> and Jane"):
            say(toycar, author)
    assert say(toycar, "Git Smith").decision(lane(toycar).id)


def test_merging_does_not_make_a_person_an_author(toycar: Workspace, root: Path) -> None:
    git(root, "checkout", "-qb", "side")
    commit(root, "templates/offset.yaml", "Joe <joe@example.org>")
    git(root, "checkout", "-q", "-")
    commit(root, LANE, "Joe <joe@example.org>")
    git(root, "merge", "-q", "side", "-m", "merged")
    with pytest.raises(MutatorError, match="Joe changed"):
        say(toycar, "Joe")
    assert say(toycar, "Git Smith").decision(lane(toycar).id)


def test_changes_that_are_not_in_git_are_refused(toycar: Workspace, root: Path) -> None:
    with (root / LANE).open("a") as file:
        file.write("# more\n")
    with pytest.raises(
        MutatorError, match=r"lane\.yaml: cannot determine .* not committed.*commit the change first"
    ):
        say(toycar, "Jane Doe")
    git(root, "rm", "-q", "--cached", LANE)
    git(root, "commit", "-qm", "less")
    with pytest.raises(MutatorError, match="not committed"):
        say(toycar, "Jane Doe")
    (root / ".git").rename(root / "git")
    with pytest.raises(MutatorError, match=r"not in a git clone.*put the file under git"):
        say(toycar, "Jane Doe")
    assert say(toycar, "Jane Doe", ReviewActionKind.REJECT).decision(lane(toycar).id)


def test_a_decision_stores_the_librarys_commit(toycar: Workspace, root: Path) -> None:
    sha = git(root, "rev-parse", "HEAD")
    for _ in range(2):  # in the second round, the first decision is uncommitted
        decision = say(toycar, "Jane Doe").decision(lane(toycar).id)
        assert decision is not None and decision.commit == sha
    (root / "fault_library/faults/sensor/new.yaml").write_text("")
    assert library_commit(toycar) == f"{sha}-dirty"


def test_mailmap_gives_no_change_to_somebody_else(toycar: Workspace, root: Path) -> None:
    commit(root, LANE, "Jane Doe <jane@example.org>")
    (root / ".mailmap").write_text("Joe <joe@example.org> <jane@example.org>\n")
    git(root, "add", ".mailmap")
    git(root, "commit", "-qm", "names")
    with pytest.raises(MutatorError, match="Jane Doe changed"):
        say(toycar, "Jane Doe")
    assert say(toycar, "Joe").decision(lane(toycar).id)


def test_the_user_name_never_comes_from_the_library(
    toycar: Workspace, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    git(root, "config", "extensions.worktreeConfig", "true")
    git(root, "config", "user.name", "Jane Doe")
    git(root, "config", "--worktree", "user.name", "Jane Doe")
    assert find_user_name(toycar.library) is None
    git(root, "config", "--global", "user.name", "A User")
    assert find_user_name(toycar.library) == "A User"
    (home / "at-work").write_text("[user]\n\tname = At Work\n")
    git(root, "config", "--global", f"includeIf.gitdir:{root}/.path", str(home / "at-work"))
    assert find_user_name(toycar.library) == "At Work", "the user's own file names two names"
