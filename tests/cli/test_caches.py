"""The `cache` command lists and deletes cached files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator._common import cache_layout_and_pruning

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json

pytestmark = pytest.mark.usefixtures("nowhere")


@pytest.fixture
def filled() -> Path:
    """A cache of three files of a target. Each takes 12 kB on any disk."""
    place = cache_layout_and_pruning.target_cache_folder("car")
    place.mkdir(parents=True)
    for name in "abc":
        (place / name).write_bytes(b"1" * 12_288)
    return place


def test_cached_files_are_listed(cli: Cli, filled: Path) -> None:
    answer = cli("cache")
    assert answer.code == 0, answer.err
    assert [line.split() for line in answer.out.splitlines()[:3]] == [
        ["what", "entries", "size"],
        ["target", "car", "3", "36.9", "kB"],
        ["total", "3", "36.9", "kB"],
    ]
    data = cli("cache", "--json").json
    assert data["path"] == str(cache_layout_and_pruning.caches_folder())
    assert [(e["what"], e["path"], e["bytes"]) for e in data["kept"]] == [
        ("target car", str(filled / name), 12_288) for name in "abc"
    ]


def test_path_prints_only_the_folder(cli: Cli) -> None:
    assert cli("cache", "--path").out == f"{cache_layout_and_pruning.caches_folder()}\n"


@pytest.mark.parametrize(
    ("words", "left"),
    [(("--max", "25kB"), 2), (("--max", "0"), 0), (("--max", "2 GB"), 3), (("--clear",), 0)],
)
def test_max_and_clear_delete_files(cli: Cli, filled: Path, words: tuple[str, ...], left: int) -> None:
    answer = cli("cache", *words, "--json")
    assert (answer.code, len(answer.json["kept"]), len(answer.json["deleted"])) == (0, left, 3 - left)
    assert len(list(filled.iterdir())) == left
    assert "deleted 0 entries, 0.0 kB" in cli("cache", *words).out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--max", "much"), "size 'much'\n  expected: a number of B, kB, MB, GB or TB"),
        (("--max", "-1"), "size '-1'"),
        (("--max", "1GB", "--clear"), "expected: one of them"),
        (("--path", "--clear"), "expected: one of them"),
    ],
)
def test_invalid_options_delete_nothing(cli: Cli, filled: Path, words: tuple[str, ...], said: str) -> None:
    answer = cli("cache", *words)
    assert answer.code == 2 and said in answer.err
    assert len(list(filled.iterdir())) == 3
