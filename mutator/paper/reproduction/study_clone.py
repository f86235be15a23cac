"""The clone that the study is driven from: its commit, and what has changed since another one."""

import subprocess
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mutator._common.shipped_files import CLONE_FOLDER, SHIPPED_ARCHIVE_PATH
from mutator.errors import MutatorError

RESULTS_PAGE = "docs/explanation/paper-results.md"
DIFFERENCES_PAGE = "docs/explanation/differences-from-the-paper.md"
FIGURE = "docs/explanation/paper-results.svg"
TABLES_FOLDER = "docs/explanation/tables"
WRITTEN_PATHS = (RESULTS_PAGE, DIFFERENCES_PAGE, FIGURE, TABLES_FOLDER + "/")
# what an experiment executes or is planned from, what judges it, and what computes tables of results
_DECIDING_PATHS = (
    *("target/", "fault_library/", "templates/", "mutator/"),
    *("constraints.txt", "pyproject.toml", "setup.py"),
)
# doors, checks and pages, which only show results
_SHOWING_PATHS = tuple(
    f"mutator/{name}/"
    for name in ("cli", "api", "serve", "web", "reference", "onboarding", "exports", "report", "checks")
)
# A campaign without defences, such as those of the study, executes nothing of these packages; a test drives
# one to see that.
UNUSED_BY_STUDY_PATHS = ("mutator/defences/", "mutator/comparison/")
# what computes the study's tables from finished runs
_STUDY_PATH = "mutator/paper/"
# What compares the study with its pages, and the templates of the pages: tables come from neither, and
# `--check` renders the pages again.
_STUDY_CHECK_PATHS = tuple(
    f"mutator/paper/reproduction/{name}" for name in ("study_check.py", "study_clone.py", "pages/")
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyClone:
    """A git clone of this project, from which `mutator` is imported. `commit` is what is checked out."""

    root: Path
    commit: str

    @classmethod
    def of_this_package(cls) -> "StudyClone":
        """Return the clone of the imported package; MutatorError without one, as in a wheel."""
        commit = (
            "" if SHIPPED_ARCHIVE_PATH.exists() else _git_output(CLONE_FOLDER, "rev-parse", "HEAD").strip()
        )
        if not commit or not (CLONE_FOLDER / ".git").exists():
            raise MutatorError(
                "this mutator was not installed from a git clone, so the study has no commit to name",
                where=CLONE_FOLDER,
                expected="a clone, installed with `pip install -e .`",
                remedy="clone the repository, install from it, and repeat the command there",
            )
        return cls(root=CLONE_FOLDER, commit=commit)

    def check_unchanged(self) -> None:
        """MutatorError if a file differs from the commit, apart from those that the study writes."""
        lines = _git_output(self.root, "status", "--porcelain", "--untracked-files=all").splitlines()
        changed = _without_written(line[3:] for line in lines)
        if changed:
            raise MutatorError(
                f"files that are not committed ({', '.join(changed[:3])})",
                where=self.root,
                expected="a clone without changes, so that the commit says what was driven",
                remedy="commit or remove them, or drive from another clone",
            )

    def decides_runs_as(self, commit: str) -> bool:
        """Return whether no file that decides runs differs from that commit; false if it is not there."""
        return self._has_commit(commit) and not files_deciding_runs(self.files_changed_since(commit))

    def decides_figures_as(self, commit: str) -> bool:
        """Return whether no file that decides figures differs from that commit; false if it is not there."""
        return self._has_commit(commit) and not files_deciding_study(self.files_changed_since(commit))

    def _has_commit(self, commit: str) -> bool:
        return _git_output(self.root, "cat-file", "-t", commit).startswith("commit")

    def files_changed_since(self, commit: str) -> tuple[str, ...]:
        """Return the files that differ from another commit, also if not committed or new; without the study's
        own.

        MutatorError if the clone does not have the commit.
        """
        if not self._has_commit(commit):
            raise MutatorError(
                f"commit {commit[:12]} is not in this clone",
                where=self.root,
                expected="a clone with its whole history",
                remedy="fetch it: `git fetch --unshallow`, or `git fetch origin COMMIT`",
            )
        names = _git_output(self.root, "diff", "--name-only", commit, "--").splitlines()
        names += _git_output(self.root, "ls-files", "--others", "--exclude-standard").splitlines()
        return _without_written(names)


def files_deciding_runs(files: Iterable[str]) -> tuple[str, ...]:
    """Return those of the files that can decide how an experiment of the study ends."""
    return tuple(name for name in files_deciding_study(files) if not name.startswith(_STUDY_PATH))


def files_deciding_study(files: Iterable[str]) -> tuple[str, ...]:
    """Return those of the files that can decide a figure of the study: a result, or what is computed from
    results.
    """
    irrelevant = (*UNUSED_BY_STUDY_PATHS, *_STUDY_CHECK_PATHS)
    return tuple(name for name in deciding_files(files) if not name.startswith(irrelevant))


def deciding_files(files: Iterable[str]) -> tuple[str, ...]:
    """Return those of the files that can decide a figure of any page."""
    return tuple(
        name for name in files if name.startswith(_DECIDING_PATHS) and not name.startswith(_SHOWING_PATHS)
    )


def _without_written(files: Iterable[str]) -> tuple[str, ...]:
    return tuple(name for name in files if not name.startswith(WRITTEN_PATHS))


def _git_output(root: Path, *arguments: str) -> str:
    """Return the output of git; '' if it fails or is not installed."""
    try:
        process = subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, check=False
        )
    except OSError:
        return ""
    return process.stdout if process.returncode == 0 else ""
