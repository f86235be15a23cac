"""Makes mutator remember parsed texts during a test session."""

import dataclasses
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import pytest

from mutator.checks import library_check
from mutator.config import yaml_files
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.faults import fault_model_files
from mutator.faults.fault_models import FaultModel, FaultModelExample, FaultModels
from mutator.mutants import parsed_files_and_anchors
from mutator.mutants.parsed_files_and_anchors import ParsedFile

_SMALL = 1 << 20  # bytes


@contextmanager
def parsed_once() -> Iterator[None]:
    """Parse each YAML and Python text and fault model, and run each example of a model, only once, because
    tests copy the same templates and toys a thousand times.

    Each caller gets its own copy. A text with a mistake is parsed anew, so that the error names its file.
    """
    parse_yaml, parse_python, load_model = (
        yaml_files.parse_yaml,
        parsed_files_and_anchors.parse_file,
        fault_model_files._load_model,
    )
    models: dict[tuple[str, bytes, bytes], FaultModel] = {}
    run_example, examples = library_check.apply_example, dict[str, str]()

    @lru_cache(maxsize=1024)
    def yaml_of(text: str) -> bytes:
        source = parse_yaml(text, Path("a.yaml"))
        return pickle.dumps((source.data, source.lines))

    @lru_cache(maxsize=256)
    def python_of(path: str, data: bytes) -> ParsedFile:
        return parse_python(path, data, Path("a"))

    def yaml(text: str, path: Path) -> YamlSource:
        try:
            data, lines = pickle.loads(yaml_of(text))
        except MutatorError:
            return parse_yaml(text, path)
        return YamlSource(path=path, data=data, lines=lines)

    def python(path: str, data: bytes, root: Path) -> ParsedFile:
        try:
            found = python_of(path, data)
        except MutatorError:
            return parse_python(path, data, root)
        return dataclasses.replace(found, full_path=root / path, verified_edits=set(), _resolved_anchors={})

    def model(path: Path) -> FaultModel:
        template = path.with_suffix(".py.j2")
        if not all(file.is_file() and file.stat().st_size < _SMALL for file in (path, template)):
            return load_model(path)
        key = path.name, path.read_bytes(), template.read_bytes()
        found = models.get(key) or models.setdefault(key, load_model(path))
        source = dataclasses.replace(found.source, path=path)
        return dataclasses.replace(found, source=source, template_path=template)

    def example_of(model: FaultModel, models: FaultModels, example: FaultModelExample) -> str:
        key = repr((model.kind, model.template, model.expression_template, model.params, example))
        return examples.get(key) or examples.setdefault(key, run_example(model, models, example))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml_files, "parse_yaml", yaml)
        patch.setattr(parsed_files_and_anchors, "parse_file", python)
        patch.setattr(fault_model_files, "_load_model", model)
        patch.setattr(library_check, "apply_example", example_of)
        yield
