"""Git data for reviews: the library's commit, and who last changed a group."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator.campaigns.git_clone import GitClone
from mutator.errors import MutatorError
from mutator.review.mutant_groups import Group
from mutator.workspace import Workspace

# NUL between the parts, because names can contain any other character
_LOG_FORMAT = "--format=%H%x00%an <%ae>%x00%(trailers:key=Co-authored-by,valueonly,separator=%x00)"


@dataclass(frozen=True, slots=True)
class _Commit:
    """A commit with its author and the co-authors that its message names.

    `.mailmap` is not read: whoever wrote it could give a change to somebody else.
    """

    id: str
    author: str  # such as `Jane Doe <jane@x.org>`
    co_authors: tuple[str, ...] = ()

    def is_by(self, reviewer: str) -> bool:
        """Whether `reviewer`, such as `Jane Doe`, `jane@x.org` or `Jane Doe <jane@x.org>`, is an author."""
        return any(
            _person_names(reviewer) & _person_names(author) for author in (self.author, *self.co_authors)
        )


def _person_names(person: str) -> set[str]:
    name, _, rest = person.partition("<")
    return {" ".join(text.split()).casefold() for text in (person, name, rest.rstrip("> "))} - {""}


def library_commit(workspace: Workspace) -> str | None:
    """Return the library's commit, with `-dirty` if more than its reviews changed since; None outside git."""
    clone = GitClone.find(workspace.library)
    if clone is None:
        return None
    return clone.commit + "-dirty" * (
        clone.differs_from_commit(workspace.library, leave_out="reviews") is not False
    )


def check_four_eyes(approvals: Sequence[tuple[Group, str]]) -> None:
    """Raise MutatorError if a reviewer approves a group that they changed last, or if a group's last author
    is unknown.
    """
    # many groups come from the same files: git, which is slow, is asked once for them
    commits_by_sources: dict[tuple[Path, ...], dict[Path, _Commit]] = {}
    for group, by in approvals:
        if group.source_files not in commits_by_sources:
            commits_by_sources[group.source_files] = _last_commits_by_clone(group)
        for folder, commit in commits_by_sources[group.source_files].items():
            if commit.is_by(by):
                raise _four_eyes_error(
                    f"{by} changed group {group.id} last (commit {commit.id[:12]} by "
                    f"{' and '.join((commit.author, *commit.co_authors))}): {group.label}",
                    folder,
                    "have somebody else approve it",
                )


def _last_commits_by_clone(group: Group) -> dict[Path, _Commit]:
    """Return the last commit that changed the group's sources, for each clone."""
    clones: dict[GitClone, list[Path]] = {}
    for path in group.source_files:
        clone = GitClone.find(path.resolve().parent)
        if clone is None:
            raise _four_eyes_error(
                f"cannot determine who last changed group {group.id}: its file is not in a git clone",
                path,
                "put the file under git",
            )
        clones.setdefault(clone, []).append(path)
    return {clone.root: _last_commit(group, clone, paths) for clone, paths in clones.items()}


def _last_commit(group: Group, clone: GitClone, paths: Sequence[Path]) -> _Commit:
    changed = clone.find_changed(paths)
    commit = (clone.describe_last_change(paths, _LOG_FORMAT) or "").strip("\n")
    if changed is not None or not commit:
        raise _four_eyes_error(
            f"cannot determine who last changed group {group.id}: its latest change is not committed",
            changed or clone.root,
            "commit the change first",
        )
    sha, author, *others = filter(None, commit.split("\0"))
    return _Commit(sha, author, tuple(others))


def _four_eyes_error(got: str, where: Path, remedy: str) -> MutatorError:
    return MutatorError(
        got,
        where=where,
        expected="a reviewer other than the author of the last change (`four_eyes` is set in this library)",
        remedy=remedy,
    )
