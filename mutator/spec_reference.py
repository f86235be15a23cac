"""The reference of the spec format, written from the schema that checks specs and from the fault models.

`python -m mutator.spec_reference` writes docs/reference/fault-spec.md of the clone it is run in; a test holds
that page against the schema.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mutator import units
from mutator.fault_models import TARGET_UNIT, FaultModel, FaultModels, ParamSchema
from mutator.spec import SCHEMA, json_schema
from mutator.workspace import Workspace

PAGE = Path("docs") / "reference" / "fault-spec.md"
EXAMPLE = Path("faults") / "radar" / "chaff.yaml"

INTRODUCTION = f"""\
# Fault specs

<!-- Written by `python -m mutator.spec_reference`; do not edit by hand. -->

A fault spec is one YAML file: a fault type of a module, in one or more variants. The library keeps it at
`fault_library/faults/<module>/<fault_type>.yaml`; `mutator try FILE --scenario S1` takes one from anywhere.

The YAML is plain: no tags, anchors or aliases, no key twice, `true` and `false` as the only booleans.
An unknown key, a wrong type, a unit of the wrong dimension or a value out of range is an error with file and
line. Numbers carry their unit in the last part of their key (`distance_m`, `by_kph`); a number without a unit
has a key without one.

The first key is `schema: {SCHEMA}`. A file of a newer schema is refused.
"""

# Which section tells of which definition of the schema, in the order of the page.
SECTIONS = {
    "_SpecModel": ("The file", ""),
    "_VariantModel": (
        "A variant",
        "A variant is one row of the library: its injections share one trigger, one draw and one aim.",
    ),
    "_DrawModel": (
        "A draw",
        "The key of a draw is a name of one's own and a unit: `distance_m`. Parameters take the drawn value "
        "by that name, without the unit, with a minus sign if wanted: `by_m: -distance`. Exactly one of "
        "`integers_from`, `reals_from` and `values` is given. The same seed and the same key draw the same "
        "values.",
    ),
    "SweepModel": (
        "A sweep",
        "Ranges of equal width at equal distances. `{first: [15, 24], step: 10, last: [245, 254]}` is the 24 "
        "ranges [15, 24], [25, 34] ... [245, 254]; one value is drawn from each, both ends included.",
    ),
    "_ReadingModel": ("A reading", ""),
    "InjectionModel": ("An injection", "One fault model applied at one place."),
    "AtModel": (
        "A place",
        "Exactly one anchor is given. It must be found exactly once in the function, in statement position; "
        "if there are several, the error lists them and `nth` chooses one. Names are as written in the "
        "source (`d_rel`, `self.angle`, `frames.extend`).",
    ),
}

ABOUT = {
    "_SpecModel.module": "The module of the controller that the fault is in.",
    "_SpecModel.fault_type": "The name of the fault type; with the module the name of the spec.",
    "_SpecModel.about": "What goes wrong, in a sentence.",
    "_SpecModel.variants": "Name of the variant -> variant; at least one.",
    "_VariantModel.aim": "The hazard it aims at, one of the target's.",
    "_VariantModel.about": "What this variant does.",
    "_VariantModel.changes": "Changes of the scenario that belong to the fault, by their names in the "
    "target's manifest.",
    "_VariantModel.hold": "How long the fault stays active, where it does not follow the trigger: "
    "`to_end` for a fault that latches.",
    "_VariantModel.draw": "One draw: name and unit -> draw. Without it the variant is a single fault.",
    "_VariantModel.as_described": "The injections in the reading of the text.",
    "_VariantModel.as_coded": "The injections in the reading of the code, where they differ.",
    "_DrawModel.integers_from": "One whole number from each range of a sweep.",
    "_DrawModel.reals_from": "One number from each range of a sweep.",
    "_DrawModel.decimals": "Round numbers of `reals_from` to so many decimals.",
    "_DrawModel.values": "These values, as they are.",
    "_DrawModel.cap": "No drawn value is above it.",
    "_DrawModel.key": "What seeds the draw, so that variants can share it; default: the variant's full name.",
    "SweepModel.first": "The first range, [low, high].",
    "SweepModel.step": "The distance from one range to the next.",
    "SweepModel.last": "The last range; whole steps above the first.",
    "_ReadingModel.injections": "At least one; any of them executed while triggered counts as activation.",
    "InjectionModel.at": "Where.",
    "InjectionModel.model": "A fault model (below).",
    "InjectionModel.unit": "The unit that the changed variable has in the source, a suffix of the table "
    "below, or `'1'` for a plain number. Needed where the model has parameters in that unit.",
    "InjectionModel.params": "Parameters of the model, their unit in the key. A value is a number, a name, "
    "the draw's name, or `{draw: ..., written_in: ..., read_as: ...}` for a number that is written in one "
    "unit and read as another.",
    "AtModel.file": "A file of the target, relative to its root.",
    "AtModel.function": "A qualified name: `measure`, `RadarSensor.measure`, `outer.<locals>.inner`.",
    "AtModel.after_assign": "After the statement that assigns to this name.",
    "AtModel.before_assign": "Before the statement that assigns to this name.",
    "AtModel.after_call": "After the statement that calls this name.",
    "AtModel.before_call": "Before the statement that calls this name; the statement a guard leaves out.",
    "AtModel.before_return": "Before the `return` of this name; empty for a bare `return`.",
    "AtModel.entry": "`true`: at the start of the function.",
    "AtModel.nth": "Which of several hits, counted from 1.",
}


def render(models: FaultModels, example: str) -> str:
    """The page. KeyError when the schema has a key that `ABOUT` does not tell of."""
    schema = json_schema()
    definitions = {"_SpecModel": schema} | schema["$defs"]
    parts = [INTRODUCTION, f"```yaml\n{example.rstrip()}\n```\n"]
    for name in sorted(definitions, key=list(SECTIONS).index):
        title, text = SECTIONS[name]
        parts += [f"## {title}\n", *([f"{text}\n"] if text else []), *_keys(name, definitions[name])]
    parts += ["## Units\n", *_units(), "## Fault models\n", MODELS]
    for model in models:
        parts += _model(model)
    return "\n".join(parts).rstrip() + "\n"


MODELS = """\
A model is a template in `templates/` with the parameters below. A model that inserts puts lines before or
after the anchored statement; one that guards wraps the statement itself. A parameter in *the variable's unit*
may be given in any unit of the same dimension. `target` may be left out where the anchor names the variable.
A *variable* is a name that the function of the anchor knows; an *import* is the dotted name of a module of
the target and of something defined in it, which the injected lines import.
"""


def _keys(name: str, definition: dict[str, Any]) -> Iterator[str]:
    yield "| key | type | default | meaning |"
    yield "|---|---|---|---|"
    required = definition.get("required", [])
    for key, value in definition["properties"].items():
        default = "needed" if key in required else _default(value)
        yield f"| `{key}` | {_type(value)} | {default} | {ABOUT[f'{name}.{key}']} |"
    yield ""


def _default(value: dict[str, Any]) -> str:
    given = value.get("default")
    return "-" if given is None else f"`{json.dumps(given)}`"


def _type(value: dict[str, Any]) -> str:
    """A JSON Schema type in words."""
    if "anyOf" in value:
        types = [v.get("type") for v in value["anyOf"]]
        # A whole number is a number.
        skipped = {"null", "integer"} if "number" in types else {"null"}
        return " or ".join(_type(v) for v in value["anyOf"] if v.get("type") not in skipped)
    if "$ref" in value:
        title = SECTIONS[value["$ref"].rsplit("/", 1)[-1]][0]
        return f"[{title.lower()}](#{title.lower().replace(' ', '-')})"
    if "enum" in value:
        return " or ".join(f"`{v}`" for v in value["enum"])
    if value["type"] == "array":
        return f"list of {_type(value['items'])}"
    if value["type"] == "object":
        inner = value.get("additionalProperties")
        return f"mapping to {_type(inner)}" if isinstance(inner, dict) else "mapping"
    words = {"string": "text", "number": "number", "integer": "whole number", "boolean": "true or false"}
    return words[value["type"]] + _bounds(value)


def _bounds(value: dict[str, Any]) -> str:
    signs = {
        "minimum": "at least",
        "maximum": "at most",
        "exclusiveMinimum": "above",
        "exclusiveMaximum": "below",
    }
    bounds = [f"{word} {value[key]:g}" for key, word in signs.items() if key in value]
    return f" ({', '.join(bounds)})" if bounds else ""


def _units() -> Iterator[str]:
    yield "| suffix | unit | quantity |"
    yield "|---|---|---|"
    for unit in units.UNITS.values():
        yield f"| `_{unit.suffix}` | {unit.symbol} | {unit.dimension} |"
    yield ""


def _model(model: FaultModel) -> Iterator[str]:
    yield f"### {model.name}\n"
    does = "Inserts." if model.kind.value == "insert" else "Guards."
    yield f"{' '.join(model.about.split())} {does}\n"
    if model.params:
        yield "| parameter | type | unit | meaning |"
        yield "|---|---|---|---|"
        yield from (_param(p) for p in model.params if p.type != "seed")
        yield ""
    example = model.examples[0]
    yield f"For example, {example.about}:\n"
    yield f"```python\n{example.after.rstrip()}\n```\n"


def _param(param: ParamSchema) -> str:
    unit = {None: "-", TARGET_UNIT: "the variable's"}.get(param.unit, param.unit)
    low = [] if param.min is None else [f"at least {param.min:g}"]
    high = [] if param.max is None else [f"at most {param.max:g}"]
    kind = param.type + (f" ({', '.join(low + high)})" if low or high else "")
    about = param.about + (" (may be left out)" if param.optional else "")
    return f"| `{param.name}` | {kind} | {unit} | {about} |"


def page(workspace: Workspace) -> str:
    """The page for a library and its templates."""
    example = (workspace.library / EXAMPLE).read_text(encoding="utf-8")
    return render(workspace.fault_models(), example)


if __name__ == "__main__":
    here = Workspace.find()
    (here.library.parent / PAGE).write_text(page(here), encoding="utf-8")
