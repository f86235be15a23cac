"""Strict reading of YAML: known keys, no duplicates, numbers in range, errors with line numbers."""

import re
from difflib import get_close_matches
from typing import NoReturn

import yaml

from selfdrive.common.errors import ConfigError

# YAML 1.1 reads 060 as 48 and 1:30 as 90; here only decimal numbers are allowed.
_DECIMAL_PATTERN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)


def read_yaml(text: str, where: str, keys: dict[str, str]) -> "YamlSection":
    """Return the mapping in a document. Raises ConfigError if it is not YAML or not a single mapping."""
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None)
        raise ConfigError(
            problem or ("nested too deeply" if isinstance(error, RecursionError) else "unreadable text"),
            where=where,
            line=None if mark is None else mark.line + 1,
            expected="valid YAML",
            remedy="correct the syntax",
        ) from None
    if node is None:
        remedy = f"write the keys {', '.join(keys)}"
        raise ConfigError("an empty file", where=where, line=1, expected="a mapping", remedy=remedy)
    return YamlSection(node, where, keys)


class YamlSection:
    """A mapping of the document. `keys` are the allowed keys with their meanings."""

    def __init__(self, node: yaml.Node, where: str, keys: dict[str, str]) -> None:
        self._where = where
        self._keys = keys
        self._nodes: dict[str, yaml.Node] = {}
        self.line = node.start_mark.line + 1
        if not isinstance(node, yaml.MappingNode):
            self._fail(node, _describe_node(node), "a mapping", f"give the keys {', '.join(keys)}")
        for key, value in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else _describe_node(key)
            if name not in keys:
                near = get_close_matches(name, keys, n=1)
                remedy = f"did you mean {near[0]!r}?" if near else "remove it"
                self._fail(key, f"unknown key {name!r}", f"one of {', '.join(keys)}", remedy)
            if name in self._nodes:
                self._fail(key, f"key {name!r} a second time", "each key once", "remove one of them")
            self._nodes[name] = value

    def __contains__(self, key: str) -> bool:
        return key in self._nodes

    def text(self, key: str, allowed: tuple[str, ...] = ()) -> str:
        node = self._node(key)
        good = isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:str" and node.value
        if not good or (allowed and node.value not in allowed):
            expected = f"one of {', '.join(allowed)}" if allowed else "a text"
            self._fail(node, f"{key}: {_describe_node(node)}", expected, f"{key} is {self._keys[key]}")
        return node.value

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        if default is not None and key not in self:
            return default
        return self._number(self._node(key), key, low, high)

    def numbers(self, key: str, low: float, high: float) -> tuple[float, ...]:
        return tuple(self._number(item, key, low, high) for item in self._items(key))

    def ascending_numbers(self, key: str, low: float, high: float) -> tuple[float, ...]:
        """Like `numbers`, strictly ascending."""
        values = self.numbers(key, low, high)
        for item, before, value in zip(self._items(key)[1:], values, values[1:], strict=False):
            if value <= before:
                self._fail(
                    item, f"{key}: {value:g} after {before:g}", "ascending numbers", "put them in order"
                )
        return values

    def key_with_unit(self, name: str, units: tuple[str, ...]) -> str:
        """Return the key that gives `name` in one of `units`; exactly one must be present."""
        matching_keys = [key for unit in units if (key := f"{name}_{unit}") in self]
        if len(matching_keys) != 1:
            names = [f"{name}_{unit}" for unit in units]
            got = " and ".join(matching_keys) if matching_keys else f"no {name}"
            self.fail(got, f"exactly one of {', '.join(names)}", "give one of these keys")
        return matching_keys[0]

    def is_list(self, key: str) -> bool:
        return isinstance(self._node(key), yaml.SequenceNode)

    def section(self, key: str, keys: dict[str, str]) -> "YamlSection":
        return YamlSection(self._node(key), self._where, keys)

    def sections(self, key: str, keys: dict[str, str]) -> list["YamlSection"]:
        return [YamlSection(item, self._where, keys) for item in self._items(key)]

    def check(self, key: str, good: bool, expected: str, remedy: str) -> None:
        if not good:
            node = self._node(key)
            self._fail(node, f"{key}: {_describe_node(node)}", expected, remedy)

    def fail(self, got: str, expected: str, remedy: str) -> NoReturn:
        raise ConfigError(got, where=self._where, line=self.line, expected=expected, remedy=remedy)

    def _node(self, key: str) -> yaml.Node:
        if key not in self._nodes:
            self.fail(f"no {key!r}", f"the key {key!r}", f"add it: {self._keys[key]}")
        return self._nodes[key]

    def _items(self, key: str) -> list[yaml.Node]:
        node = self._node(key)
        if not isinstance(node, yaml.SequenceNode) or not node.value:
            self._fail(node, f"{key}: {_describe_node(node)}", "a list", "write it as [a, b, ...]")
        return node.value

    def _number(self, node: yaml.Node, key: str, low: float, high: float) -> float:
        plain = isinstance(node, yaml.ScalarNode) and node.style is None
        value = float(node.value) if plain and _DECIMAL_PATTERN.fullmatch(node.value) else None
        if value is None or not low <= value <= high:
            expected = f"a number from {low:g} to {high:g}"
            self._fail(node, f"{key}: {_describe_node(node)}", expected, f"{key} is {self._keys[key]}")
        return value

    def _fail(self, node: yaml.Node, got: str, expected: str, remedy: str) -> NoReturn:
        line = node.start_mark.line + 1
        raise ConfigError(got, where=self._where, line=line, expected=expected, remedy=remedy)


def _describe_node(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        return repr(node.value)[:60]
    return "a list" if isinstance(node, yaml.SequenceNode) else "a mapping"
