"""Placeholders such as `{out}` in the arguments of a target's commands."""

import re
from collections.abc import Iterable, Mapping, Sequence

from mutator.config.yaml_source_lines import KeyPath, YamlSource

RUN_PLACEHOLDERS = ("scenario", "seed", "out", "cache", "root")
FILMED_RUN_PLACEHOLDERS = (*RUN_PLACEHOLDERS, "film")
FILM_PLACEHOLDERS = ("golden", "faulty", "events", "out", "t")
_PLACEHOLDER_PATTERN = re.compile(r"\{([A-Za-z_]\w*)\}")


def fill_placeholders(arguments: Iterable[str], values: Mapping[str, str]) -> list[str]:
    return [_PLACEHOLDER_PATTERN.sub(lambda match: values[match[1]], argument) for argument in arguments]


def check_placeholders(
    arguments: Sequence[str], allowed: Sequence[str], source: YamlSource, keys: KeyPath
) -> None:
    for i, argument in enumerate(arguments):
        for name in _PLACEHOLDER_PATTERN.findall(argument):
            if name not in allowed:
                raise source.error(
                    (*keys, i),
                    f"'{{{name}}}' in '{argument}'",
                    expected=f"one of {', '.join(f'{{{choice}}}' for choice in allowed)}",
                    remedy="correct the name; braces around anything but a name are left unchanged",
                )
