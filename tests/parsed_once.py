"""Makes mutator remember parsed texts during a test session."""

import dataclasses
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import pytest

from mutator.config import yaml_files
from mutator.config.yaml_files import Source
from mutator.errors import MutatorError
from mutator.mutants import anchors
from mutator.mutants.anchors import ParsedFile


@contextmanager
def parsed_once() -> Iterator[None]:
    """Parse each YAML and Python text once, because tests copy the same templates and toys a thousand times.

    Each caller gets its own copy. A text with a mistake is parsed anew, so that the error names its file.
    """
    parse_yaml, parse_python = yaml_files.parse, anchors.parse_file

    @lru_cache(maxsize=1024)
    def yaml_of(text: str) -> bytes:
        source = parse_yaml(text, Path("a.yaml"))
        return pickle.dumps((source.data, source.lines))

    @lru_cache(maxsize=256)
    def python_of(path: str, data: bytes) -> ParsedFile:
        return parse_python(path, data, Path("a"))

    def yaml(text: str, path: Path) -> Source:
        try:
            data, lines = pickle.loads(yaml_of(text))
        except MutatorError:
            return parse_yaml(text, path)
        return Source(path=path, data=data, lines=lines)

    def python(path: str, data: bytes, root: Path) -> ParsedFile:
        try:
            found = python_of(path, data)
        except MutatorError:
            return parse_python(path, data, root)
        return dataclasses.replace(found, where=root / path, sound=set(), _sites={})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml_files, "parse", yaml)
        patch.setattr(anchors, "parse_file", python)
        yield
