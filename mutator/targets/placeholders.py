"""Placeholders such as `{out}` in the arguments of a target's commands."""

import re
from collections.abc import Iterable, Mapping, Sequence

from mutator.config.yaml_sources import KeyPath, YamlSource

OF_RUNS = ("scenario", "seed", "out", "cache", "root")
OF_FILMED_RUNS = (*OF_RUNS, "film")
OF_FILMS = ("golden", "faulty", "events", "out", "t")
_PLACEHOLDER = re.compile(r"\{([A-Za-z_]\w*)\}")


def filled(arguments: Iterable[str], values: Mapping[str, str]) -> list[str]:
    return [_PLACEHOLDER.sub(lambda found: values[found[1]], argument) for argument in arguments]


def check_placeholders(
    arguments: Sequence[str], known: Sequence[str], source: YamlSource, keys: KeyPath
) -> None:
    for i, argument in enumerate(arguments):
        for name in _PLACEHOLDER.findall(argument):
            if name not in known:
                raise source.error(
                    (*keys, i),
                    f"'{{{name}}}' in '{argument}'",
                    expected=f"one of {', '.join(f'{{{one}}}' for one in known)}",
                    remedy="correct the name; braces around anything but a name are left unchanged",
                )
