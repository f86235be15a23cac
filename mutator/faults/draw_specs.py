"""Draws: how the values of a variant are made."""

import re
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, model_validator

from mutator.config import units
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import KeyPath, YamlSource

_MOST_RANGES = 1000  # of a sweep; more mean a mistyped step, and each range is a fault
_MOST_DRAWN_NUMBER = 1e15  # limit of a drawn number: whole numbers up to it are exact
_NAME_PATTERN = re.compile(r"[a-z][a-z0-9_]*\Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawSpec:
    """How a variant's values are made: one draw from each range, or a list.

    Values are in `unit`, the suffix of the YAML key (None for plain numbers). `key` and the campaign's seed
    determine the draw: equal keys and ranges give equal values.
    """

    key: str
    name: str
    unit: str | None
    kind: Literal["integers", "reals", "list"]
    ranges: tuple[tuple[float, float], ...] = ()
    values: tuple[float | int, ...] = ()
    decimals: int | None = None
    cap: float | None = None
    keys: KeyPath = ()

    @property
    def value_count(self) -> int:
        return len(self.values) if self.kind == "list" else len(self.ranges)

    @property
    def least_and_greatest(self) -> tuple[float, float]:
        """The least and the greatest possible value."""
        ends = self.values or [end for ends in self.ranges for end in ends]
        return min(ends), max(ends) if self.cap is None else min(max(ends), self.cap)


_DrawnNumber = Annotated[float, Field(ge=-_MOST_DRAWN_NUMBER, le=_MOST_DRAWN_NUMBER, allow_inf_nan=False)]


class SweepModel(StrictModel, title="A sweep"):
    """Ranges of equal width at equal distances. `{first: [15, 24], step: 10, last: [245, 254]}` gives the
    24 ranges [15, 24], [25, 34] ... [245, 254]. One value is drawn from each range, both ends included.
    """

    first: list[_DrawnNumber] = Field(description="The first range, [low, high].")
    step: float = Field(gt=0.0, allow_inf_nan=False, description="The distance from one range to the next.")
    last: list[_DrawnNumber] = Field(description="The last range, a whole number of steps above the first.")

    @model_validator(mode="after")
    def _check_ranges(self) -> "SweepModel":
        self.ranges()
        return self

    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Return all ranges as (low, high); ValueError if the sweep is not valid."""
        if len(self.first) != 2 or len(self.last) != 2 or not self.first[0] <= self.first[1]:
            raise ValueError("first and last as [low, high]")
        low, high = self.first
        steps = (self.last[0] - low) / self.step
        if steps >= _MOST_RANGES:
            raise ValueError(f"at most {_MOST_RANGES} ranges")
        ranges = tuple((low + i * self.step, high + i * self.step) for i in range(round(steps) + 1))
        # the step times a number is not exact in binary: 3 * 0.1 is not 0.3
        if not ranges or any(abs(a - b) > 1e-9 for a, b in zip(ranges[-1], self.last, strict=True)):
            raise ValueError("a last range that is a whole number of steps above the first")
        return ranges


class DrawModel(StrictModel, title="A draw"):
    """The key of a draw is a name of your choice and a unit: `distance_m`. Parameters refer to the drawn
    value by that name without the unit, optionally with a minus sign: `by_m: -distance`. Give exactly one of
    `integers_from`, `reals_from` and `values`. The same seed and key give the same values. Several draws must
    all have `values`, which then belong together: the first values of all make one fault, the second ones the
    next.
    """

    integers_from: SweepModel | None = Field(None, description="One whole number from each range of a sweep.")
    reals_from: SweepModel | None = Field(None, description="One number from each range of a sweep.")
    decimals: int | None = Field(
        None, ge=0, le=12, description="The number of decimals to which values of `reals_from` are rounded."
    )
    values: list[float | int] | None = Field(None, description="A list of values, used unchanged.")
    cap: float | None = Field(
        None, allow_inf_nan=False, description="The maximum: larger drawn values are reduced to it."
    )
    key: str | None = Field(
        None,
        description="A name that seeds the draw together with the campaign's seed. Variants can share it. "
        "Default: the variant's full name.",
    )


def check_name(name: str, source: YamlSource, keys: KeyPath) -> None:
    if not _NAME_PATTERN.match(name):
        raise source.error(keys, f"'{name}'", expected="lowercase letters, digits and _", remedy="rename it")


def build_draws(
    default_key: str, models: dict[str, DrawModel], source: YamlSource, keys: KeyPath
) -> tuple[DrawSpec, ...]:
    if not models:
        raise source.error(keys, "no draw", expected="at least one", remedy="leave out `draw`")
    draws = tuple(_build_draw(default_key, key, model, source, keys) for key, model in models.items())
    if len(draws) > 1:
        _check_paired(draws, source, keys)
    return draws


def _check_paired(draws: tuple[DrawSpec, ...], source: YamlSource, keys: KeyPath) -> None:
    first = draws[0]
    for draw in draws:
        if draw.kind != "list":
            raise source.error(
                draw.keys,
                f"{len(draws)} draws, one of them by chance",
                expected="`values` in each of several draws, or one draw",
                remedy="use one draw for all injections, or write the values down in pairs",
            )
        if draw.value_count != first.value_count:
            raise source.error(
                draw.keys,
                f"{draw.value_count} values",
                expected=f"{first.value_count}, as many as in `{first.keys[-1]}`",
                remedy="give every fault a value in each list",
            )
    if len({draw.name for draw in draws}) != len(draws):
        raise source.error(keys, f"'{first.name}' twice", expected="draws with different names")
    repeated = [value for i, value in enumerate(first.values) if value in first.values[:i]]
    if repeated:
        raise source.error(
            first.keys,
            f"{repeated[0]:g} twice",
            expected="different values in the first of several lists, because they name the faults",
            remedy="put a list without repetition first, or make two variants",
        )


def _build_draw(default_key: str, key: str, model: DrawModel, source: YamlSource, keys: KeyPath) -> DrawSpec:
    name, unit = units.split_key_at_unit(key)
    check_name(name, source, (*keys, key))
    ways = {"integers": model.integers_from, "reals": model.reals_from, "list": model.values}
    kinds = [kind for kind, way in ways.items() if way is not None]
    draw_keys = (*keys, key)
    if len(kinds) != 1:
        raise source.error(
            draw_keys, f"{len(kinds)} ways to draw", expected="integers_from, reals_from or values"
        )
    kind: Literal["integers", "reals", "list"] = kinds[0]  # type: ignore[assignment]
    ranges = model.integers_from or model.reals_from
    if model.integers_from and any(x != int(x) for pair in model.integers_from.ranges() for x in pair):
        raise source.error((*draw_keys, "integers_from"), "a range with fractions", expected="whole numbers")
    if model.decimals is not None and kind != "reals":
        raise source.error(
            (*draw_keys, "decimals"),
            f"decimals: {model.decimals}",
            expected="`decimals` only with reals_from",
        )
    return DrawSpec(
        key=model.key or default_key,
        name=name,
        unit=unit.suffix if unit else None,
        kind=kind,
        ranges=ranges.ranges() if ranges else (),
        values=tuple(model.values or ()),
        decimals=model.decimals,
        cap=model.cap,
        keys=draw_keys,
    )
