"""Malformed versions of the YAML, templates and sources that people write."""

from collections.abc import Callable
from pathlib import Path

import yaml

from .damages import DAMAGES, STRANGE, Chance, changed

Malform = Callable[[str, Chance], str]

# fmt: off
WILD: tuple[object, ...] = (
    *STRANGE,
    1e308, -1e-320, 10**9, 10**18, float("inf"), "inf", "nan", "1e999", "0x10", "yes", "2024-01-01", "~",
    "{{ 7 * 7 }}", "{% for i in range(10**9) %}{% endfor %}", "__import__('os').system('true')", "a.b.c",
    "t >= 1 and " * 500 + "true", "(" * 400 + "t" + ")" * 400, "-" * 900 + "1", "9" * 5000, "x" * 200_000,
    "../../../etc/passwd", "/etc/passwd", "a/../..", "**/*", "[", "*", "?" * 300, "\u202e", "\ud7ff",
    "\x1b[2J", [[[[[]]]]], {"a": {"a": {"a": {}}}}, [1] * 5000, {str(i): i for i in range(2000)},
    {"from": 0, "to": 1e9, "step": 1e-9}, {"from": 0, "to": 1, "step": 0}, [0, 1e300], "0..1e9",
)
SHAPES = (
    "[" * 900, "[" * 50_000 + "]" * 50_000, "{a: " * 20_000, "- " * 100_000, "? " * 50_000, "a:" * 50_000,
    "a: *a", "&a [*a]", "<<: {a: 1}", "!!python/object/apply:os.system [true]", "%YAML 9.9\n---\n",
    "---\n" * 5000, "\t", "\r", "\0", "'", '"', "|\n", "\ufeff", "\x85", "#" * 100_000,
    "".join(" " * i + "a:\n" for i in range(900)),
)
# fmt: on


def change_a_value(text: str, chance: Chance) -> str:
    data = changed(yaml.safe_load(text), chance, WILD)
    return yaml.safe_dump(data, allow_unicode=True, sort_keys=False)


def insert_a_shape(text: str, chance: Chance) -> str:
    places = [place for place, letter in enumerate(text) if letter in " \n"] or [0]
    place = chance.choice(places)
    return text[: place + 1] + chance.choice(SHAPES) + text[place + 1 :]


def repeat_a_line(text: str, chance: Chance) -> str:
    lines = text.splitlines(keepends=True) or ["a\n"]
    place = chance.randrange(len(lines))
    return "".join([*lines[:place], lines[place] * chance.choice([2, 3000]), *lines[place + 1 :]])


def indent_a_line(text: str, chance: Chance) -> str:
    lines = text.splitlines(keepends=True) or ["a\n"]
    place = chance.randrange(len(lines))
    return "".join([*lines[:place], chance.choice([" ", "\t"]) + lines[place], *lines[place + 1 :]])


MALFORMS: dict[str, Malform] = {
    one.__name__: one for one in (change_a_value, insert_a_shape, repeat_a_line, indent_a_line)
}


def malform(path: Path, chance: Chance) -> str:
    """Damage a hand-written file, half of the time in a way specific to its kind. Return the way."""
    text = path.read_text(encoding="utf-8")
    ways = [*MALFORMS] if path.suffix == ".yaml" else [*MALFORMS][1:]
    # readers mostly check values
    how = chance.choice([*DAMAGES, *ways * 4] + ["change_a_value"] * 20 * (path.suffix == ".yaml"))
    if how in MALFORMS:
        path.write_text(MALFORMS[how](text, chance), encoding="utf-8", newline="")
    else:
        DAMAGES[how](path, [other for other in path.parent.iterdir() if other.is_file()], chance)
    return how
