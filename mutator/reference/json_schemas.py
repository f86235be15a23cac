"""JSON Schemas of the YAML files, for editors. Names in the files are checked only by `mutator check`."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from mutator.campaigns import campaign_files, campaign_model
from mutator.config import units
from mutator.config.yaml_files import StrictModel
from mutator.execution.cluster import cluster_files
from mutator.faults import fault_model_files, library_readings
from mutator.faults import fault_specs as spec
from mutator.faults.fault_models import NAMES, TARGET_UNIT, FaultModel, FaultModels, ParamSchema
from mutator.faults.injection_specs import DIMENSIONLESS
from mutator.faults.library_readings import Readings
from mutator.stpa import analysis_files, context_tables, hazard_list
from mutator.targets import manifest_files, severity_model

DRAFT = "http://json-schema.org/draft-07/schema#"  # best supported by editors
_MODEL = re.compile(r"^_?(\w+?)Model$")
_LINK = re.compile(r"\[([^]]+)\]\([^)]+\)")
_DRAWN = {
    "type": "object",
    "required": ["draw", "written_in", "read_as"],
    "properties": {
        "draw": {"type": "string", "pattern": "^-?[a-z][a-z0-9_]*$"},
        "written_in": {"enum": list(units.UNITS)},
        "read_as": {"enum": list(units.UNITS)},
    },
    "additionalProperties": False,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A kind of YAML file: its model, the value of its `schema` key, and the glob of its files in a clone."""

    model: type[StrictModel]
    schema: str
    files: str

    @property
    def name(self) -> str:
        return self.schema.partition("/")[0]


_FILES: tuple[tuple[type[StrictModel], str, str], ...] = (
    (library_readings.ReadingsModel, library_readings.SCHEMA, "readings.yaml"),
    (campaign_model.CampaignModel, campaign_files.SCHEMA, "campaigns/*.yaml"),
    (manifest_files.ManifestModel, manifest_files.SCHEMA, "targets/*.yaml"),
    (severity_model.ScaleModel, severity_model.SCHEMA, "severity/*.yaml"),
    (hazard_list.HazardsModel, hazard_list.HAZARDS_SCHEMA, "stpa/hazards.yaml"),
    (context_tables.TableModel, context_tables.CONTEXT_SCHEMA, "stpa/contexts/*.yaml"),
    (analysis_files.StructureModel, "control_structure/1", "stpa/control_structure.yaml"),
    (analysis_files.UnsafeActionsModel, "unsafe_control_actions/1", "stpa/unsafe_control_actions.yaml"),
    (analysis_files.FactorsModel, "causal_factors/1", "stpa/causal_factors.yaml"),
)


def file_formats(declared: Readings) -> tuple[Format, ...]:
    specs = (spec.spec_model(declared), spec.SCHEMA, "faults/*/*.yaml")
    return (
        *(Format(model=m, schema=s, files=f"fault_library/{files}") for m, s, files in (specs, *_FILES)),
        Format(
            model=fault_model_files.FaultModelModel, schema=fault_model_files.SCHEMA, files="templates/*.yaml"
        ),
        Format(
            model=cluster_files.ClusterModel, schema=cluster_files.SCHEMA, files="docs/how-to/clusters/*.yaml"
        ),
    )


def definitions(model: type[StrictModel]) -> dict[str, dict[str, Any]]:
    """Return the JSON Schema of every model in a file of `model`, by short name (`Variant`), that of `model`
    first.

    Each schema has the class's title, its docstring in one line, and descriptions of its properties.
    """
    whole = model.model_json_schema(by_alias=True)
    parts = {model.__name__: whole} | whole.pop("$defs", {})
    return {short_name(name): _described(part) for name, part in parts.items()}


def short_name(name: str) -> str:
    """Return `Variant` for `_VariantModel`; other names stay unchanged."""
    match = _MODEL.match(name)
    return match[1] if match else name


def _described(part: dict[str, Any]) -> dict[str, Any]:
    kept: dict[str, Any] = _clean(part)
    if "properties" in part:
        kept["title"] = part["title"]
        kept["description"] = " ".join(part.get("description", "").split())
        for key, value in part["properties"].items():
            kept["properties"][key]["description"] = value["description"]
    return kept


def _clean(value: Any) -> Any:
    """Drop the titles and descriptions that pydantic generates, and shorten references."""
    if isinstance(value, list):
        return [_clean(item) for item in value]
    if not isinstance(value, dict):
        return value
    kept = {
        key: _clean(inner)
        for key, inner in value.items()
        if key not in ("title", "description", "properties")
    }
    if "properties" in value:  # the keys of `properties` are names, not JSON Schema keywords
        kept["properties"] = {key: _clean(inner) for key, inner in value["properties"].items()}
    if "$ref" in kept:
        kept["$ref"] = f"#/definitions/{short_name(kept['$ref'].rpartition('/')[2])}"
    return kept


def editor_schema(kind: Format, models: FaultModels) -> dict[str, Any]:
    parts = definitions(kind.model)
    if "Injection" in parts:
        _with_models(parts["Injection"], models)
    if "Variant" in parts:  # another library can declare other readings
        parts["Variant"]["additionalProperties"] = {"$ref": "#/definitions/Reading"}
    for part in parts.values():
        part.pop("title", None)
        part.pop("description", None)
        for value in part.get("properties", {}).values():
            value["description"] = _LINK.sub(r"\1", value["description"])
    whole = parts.pop(short_name(kind.model.__name__))
    key = {"const": kind.schema, "description": "The format of this file and its version."}
    whole["properties"] = {"schema": key} | whole["properties"]
    whole["required"] = ["schema", *whole["required"]]
    head = {"$schema": DRAFT, "title": kind.schema}
    return head | whole | ({"definitions": parts} if parts else {})


def _with_models(injection: dict[str, Any], models: FaultModels) -> None:
    properties = injection["properties"]
    properties["model"]["anyOf"] = [{"enum": [model.name for model in models]}, {"type": "string"}]
    properties["unit"]["anyOf"] = [{"enum": [*units.UNITS, DIMENSIONLESS]}, {"type": "null"}]
    injection["allOf"] = [_parameters(model) for model in models]


def _parameters(model: FaultModel) -> dict[str, Any]:
    known = {"required": ["model"], "properties": {"model": {"const": model.name}}}
    patterns = {
        f"^({'|'.join(keys(param))})$": _value(param) | {"description": param.about}
        for param in model.params
        if param.type != "seed"
    }
    params = {"patternProperties": patterns, "additionalProperties": False}
    return {"if": known, "then": {"properties": {"params": params}}}


def keys(param: ParamSchema) -> Iterator[str]:
    """Yield the keys of a parameter in a spec, one for each possible unit."""
    if param.unit in (None, TARGET_UNIT):
        yield param.name
    if param.unit is not None:
        own = units.UNITS.get(param.unit)
        for unit in units.UNITS.values():
            if own is None or unit.dimension == own.dimension:
                yield f"{param.name}_{unit.suffix}"


def _value(param: ParamSchema) -> dict[str, Any]:
    if param.type in NAMES:
        return {"type": "string"}
    if param.type == "boolean":
        return {"type": "boolean"}
    if param.type in ("choice", "unit"):
        return {"enum": list(param.choices or units.UNITS)}
    more = [{"type": "boolean"}, {"type": "null"}] if param.type == "constant" else []
    return {"anyOf": [{"type": "number"}, {"type": "string"}, _DRAWN, *more]}
