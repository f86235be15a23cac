"""Files of records, timings, proof, patches and series are opened for writing in one place,
`store/run_writer.py`. Only merging writes patches by itself: those of a whole shard, beside copied lines.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

MUTATOR = Path(__file__).parents[2] / "mutator"
WRITERS = {"LineWriter", "PatchWriter", "SeriesWriter", "write_lines_with_new_head"}
EXCEPTIONS = {"execution/shard_merging.py": {"PatchWriter"}}


def uses(tree: ast.Module) -> Iterator[str]:
    """The writers that a module names, imported or not; those that it defines are no use."""
    for node in ast.walk(tree):
        match node:
            case ast.alias(name=name) | ast.Name(id=name) | ast.Attribute(attr=name) if name in WRITERS:
                yield name


def test_one_module_opens_files_of_results_for_writing() -> None:
    found = {
        path.relative_to(MUTATOR).as_posix(): {*uses(ast.parse(path.read_bytes()))}
        for path in MUTATOR.rglob("*.py")
    }
    assert {name: names for name, names in found.items() if names} == {
        "store/run_writer.py": WRITERS
    } | EXCEPTIONS
