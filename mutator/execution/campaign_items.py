"""A campaign's file and its experiments as pytest collects them. Collecting runs nothing."""

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import pytest

from mutator._common.files import raising_disk_full
from mutator.errors import DiskFull, MutatorError, PytestItemFailed, ResourceShortage
from mutator.execution.item_running import FinishedItems, ItemRunner
from mutator.execution.listed_items import ItemListing, ListedItem
from mutator.execution.worker_problems import describe_problem, reported_error

PROBLEM_KEY = "mutator_problem"
_COMMON_MARKER = "mutator"


SourceT = TypeVar("SourceT", bound="ItemSource")


class ItemSource(ABC):
    """A campaign, as the items of its file need it in this process."""

    def __init__(self) -> None:
        self._runner: ItemRunner | FinishedItems | None = None
        self._has_failed = False
        self.collected_path: Path | None = None  # by which pytest came to the file

    @property
    @abstractmethod
    def listing(self) -> ItemListing: ...

    @abstractmethod
    def _begin(self) -> ItemRunner | FinishedItems:
        """Return the runner of this process, once the checks have passed."""

    def ensure_runner(self) -> ItemRunner | FinishedItems:
        """Return the runner of this process; the first call may run the checks before the campaign.

        If they fail, the first item fails with the reason, and the others are skipped.
        """
        if self._has_failed:
            pytest.skip("the campaign could not begin: see its first item")
        if self._runner is None:
            self._has_failed = True
            self._runner = self._begin()
            self._has_failed = False
        return self._runner


class CampaignItem(pytest.Item):
    """An item that does work of a campaign. It fails for harness errors, and for results if a user asks."""

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        if isinstance(excinfo.value, PytestItemFailed | MutatorError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        return self.path, None, self.name


class ExperimentItem(CampaignItem):
    """One experiment, the experiments of a chunk of a large plan, or the planes of a location."""

    def __init__(self, *, listed: ListedItem, source: ItemSource, **keywords: Any) -> None:
        super().__init__(**keywords)
        self.listed, self._source = listed, source
        for name in (_COMMON_MARKER, *listed.markers):
            self.add_marker(_marker(name))
        self.extra_keyword_matches.update(listed.keywords)

    def runtest(self) -> None:
        try:
            with raising_disk_full(self.config.rootpath):
                ending = self._source.ensure_runner().run(self.listed)
        except Exception as err:
            error = reported_error(err)
            problem = str(error) if error else _describe_defect(err, self.name)
            self.user_properties.append((PROBLEM_KEY, problem))
            if isinstance(error, DiskFull | ResourceShortage):
                self.session.shouldstop = problem
            raise
        if ending.problems:
            raise PytestItemFailed("\n".join(ending.problems))
        if ending.reason_left_out:
            pytest.skip(f"left out: {ending.reason_left_out}")

    def reportinfo(self) -> tuple[Path, int | None, str]:
        file, line = self.listed.place
        # pytest writes the dots of a test's own name as `::`
        title = f"{self.path.stem}: {self.name}"
        return Path(file) if file else self.path, None if line is None else line - 1, title


class CampaignFile(pytest.File):
    """A campaign's file, with the items of its run without defences, and of those with its sets."""

    def __init__(self, *, sources: Sequence[ItemSource], **keywords: Any) -> None:
        super().__init__(**keywords)
        self._sources = sources

    def collect(self) -> Iterator[ExperimentItem]:
        for source in self._sources:
            if source.listing.problem:
                raise self.CollectError(source.listing.problem)
            for listed in source.listing.items:
                yield ExperimentItem.from_parent(self, name=listed.name, listed=listed, source=source)


def key_of_set(defence_set: str, name: str) -> str:
    """Return the name of an item, or of a source of items, with a set of defences."""
    return f"{defence_set}--{name}"


def sources_of_sets(path: Path, sources: Mapping[str, SourceT]) -> list[SourceT]:
    """Return the sources of a campaign's runs with defences."""
    return [source for key, source in sources.items() if key != file_of(key) == os.path.realpath(path)]


def key_in_file(path: str, defence_set: str) -> str:
    """Return the key of a campaign's run with a set of defences; its run without has the file's path."""
    return f"{path}::{defence_set}"


def file_of(key: str) -> str:
    """Return the path of a source's file."""
    return key.partition("::")[0]


def node_id_of_file(session: pytest.Session, path: Path) -> str:
    """Return the node id of a file, which can be outside of the folder of pytest's settings."""
    return Path(os.path.relpath(path, session.config.rootpath)).as_posix()


def collect_alone(session: pytest.Session, file: pytest.File) -> bool:
    """Make the items of one file the session's only ones. Unlike pytest, load no code from the folders above
    the file, which can be somebody else's library.
    """
    hook = session.config.hook
    report = hook.pytest_make_collect_report(collector=file)
    session.items = list(report.result) if report.passed else []
    for item in session.items:
        hook.pytest_itemcollected(item=item)
    hook.pytest_collectreport(report=report)
    hook.pytest_collection_modifyitems(session=session, config=session.config, items=session.items)
    hook.pytest_collection_finish(session=session)
    session.testscollected = len(session.items)
    return True


def source_of(path: Path, sources: Mapping[str, ItemSource]) -> ItemSource | None:
    """Return the campaign in a file that pytest comes to; `sources` are by real path. None if there is none,
    or if pytest has come to the same file by another name, such as that of a symbolic link.
    """
    source = sources.get(os.path.realpath(path))
    if source is None:
        return None
    if source.collected_path is None:
        source.collected_path = path
    return source if source.collected_path == path else None


@lru_cache
def _marker(name: str) -> pytest.MarkDecorator:
    """Return a marker that needs no registration, because libraries name it."""
    return pytest.MarkDecorator(pytest.Mark(name, (), {}, _ispytest=True), _ispytest=True)


def _describe_defect(err: Exception, item_name: str) -> str:
    request = f"{item_name} failed because of a defect in mutator; please report it with these lines:"
    return f"{request}\n{describe_problem(err)}"
