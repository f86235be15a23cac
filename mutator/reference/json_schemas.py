"""JSON Schemas of the YAML files, for editors. Names in the files are checked only by `mutator check`."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from mutator.campaigns import campaign_files, campaign_model
from mutator.config import units
from mutator.config.yaml_files import StrictModel
from mutator.defences import defence_yaml
from mutator.execution.cluster import cluster_files
from mutator.families import family_yaml
from mutator.faults import fault_model_files, library_readings
from mutator.faults import fault_specs as spec
from mutator.faults.fault_models import (
    NAME_PARAM_TYPES,
    UNIT_OF_CHANGED_VARIABLE,
    FaultModel,
    FaultModels,
    ParamSchema,
)
from mutator.faults.library_readings import SpecReadings
from mutator.stpa import accidents_and_hazards, context_tables, hazard_analysis_yaml
from mutator.targets import manifest_files, severity_yaml

SCHEMA_DRAFT = "http://json-schema.org/draft-07/schema#"  # best supported by editors
_MODEL_NAME_PATTERN = re.compile(r"^_?(\w+?)Model$")
_MARKDOWN_LINK_PATTERN = re.compile(r"\[([^]]+)\]\([^)]+\)")
_DRAWN_VALUE_SCHEMA = {
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
class YamlFormat:
    """A kind of YAML file: its model, the value of its `schema` key, and the glob of its files in a clone."""

    model: type[StrictModel]
    schema: str
    files_glob: str

    @property
    def name(self) -> str:
        return self.schema.partition("/")[0]


_FIXED_FORMATS: tuple[tuple[type[StrictModel], str, str], ...] = (
    (library_readings.ReadingsModel, library_readings.SCHEMA, "readings.yaml"),
    (campaign_model.CampaignModel, campaign_files.SCHEMA, "campaigns/*.yaml"),
    (family_yaml.FamilyModel, family_yaml.FAMILY_SCHEMA, "families/*.yaml"),
    (defence_yaml.DefenceModel, defence_yaml.SCHEMA, "defences/*.yaml"),
    (manifest_files.ManifestModel, manifest_files.SCHEMA, "targets/*.yaml"),
    (severity_yaml.SeverityScaleModel, severity_yaml.SCHEMA, "severity/*.yaml"),
    (accidents_and_hazards.HazardsModel, accidents_and_hazards.HAZARDS_SCHEMA, "stpa/hazards.yaml"),
    (context_tables.ContextTableModel, context_tables.CONTEXT_TABLE_SCHEMA, "stpa/contexts/*.yaml"),
    (hazard_analysis_yaml.ControlStructureModel, "control_structure/1", "stpa/control_structure.yaml"),
    (hazard_analysis_yaml.UnsafeActionsModel, "unsafe_control_actions/1", "stpa/unsafe_control_actions.yaml"),
    (hazard_analysis_yaml.CausalFactorsModel, "causal_factors/1", "stpa/causal_factors.yaml"),
)


def yaml_formats(declared_readings: SpecReadings) -> tuple[YamlFormat, ...]:
    specs = (spec.build_spec_model(declared_readings), spec.SCHEMA, "faults/*/*.yaml")
    return (
        *(
            YamlFormat(model=m, schema=s, files_glob=f"fault_library/{files_glob}")
            for m, s, files_glob in (specs, *_FIXED_FORMATS)
        ),
        YamlFormat(
            model=fault_model_files.FaultModelModel,
            schema=fault_model_files.SCHEMA,
            files_glob="templates/*.yaml",
        ),
        YamlFormat(
            model=cluster_files.ClusterModel,
            schema=cluster_files.CLUSTER_FILE_SCHEMA,
            files_glob="docs/how-to/clusters/*.yaml",
        ),
    )


def schema_by_model(model: type[StrictModel]) -> dict[str, dict[str, Any]]:
    """Return the JSON Schema of every model in a file of `model`, by short name (`Variant`), that of `model`
    first.

    Each schema has the class's title, its docstring in one line, and descriptions of its properties.
    """
    file_schema = model.model_json_schema(by_alias=True)
    schemas = {model.__name__: file_schema} | file_schema.pop("$defs", {})
    return {short_model_name(name): _with_descriptions(part) for name, part in schemas.items()}


def short_model_name(name: str) -> str:
    """Return `Variant` for `_VariantModel`; other names stay unchanged."""
    match = _MODEL_NAME_PATTERN.match(name)
    return match[1] if match else name


def _with_descriptions(part: dict[str, Any]) -> dict[str, Any]:
    schema: dict[str, Any] = _without_generated_texts(part)
    if "properties" in part:
        schema["title"] = part["title"]
        schema["description"] = " ".join(part.get("description", "").split())
        for key, value in part["properties"].items():
            schema["properties"][key]["description"] = value["description"]
    return schema


def _without_generated_texts(value: Any) -> Any:
    """Drop the titles and descriptions that pydantic generates, and shorten references."""
    if isinstance(value, list):
        return [_without_generated_texts(item) for item in value]
    if not isinstance(value, dict):
        return value
    cleaned = {
        key: _without_generated_texts(inner)
        for key, inner in value.items()
        if key not in ("title", "description", "properties")
    }
    if "properties" in value:  # the keys of `properties` are names, not JSON Schema keywords
        cleaned["properties"] = {
            key: _without_generated_texts(inner) for key, inner in value["properties"].items()
        }
    if "$ref" in cleaned:
        cleaned["$ref"] = f"#/definitions/{short_model_name(cleaned['$ref'].rpartition('/')[2])}"
    return cleaned


def build_editor_schema(file_format: YamlFormat, fault_models: FaultModels) -> dict[str, Any]:
    schemas = schema_by_model(file_format.model)
    if "Injection" in schemas:
        _add_fault_models(schemas["Injection"], fault_models)
    if "Variant" in schemas:  # another library can declare other readings
        schemas["Variant"]["additionalProperties"] = {"$ref": "#/definitions/Reading"}
        schemas["Variant"]["required"] = ["about"]
    for part in schemas.values():
        part.pop("title", None)
        part.pop("description", None)
        for value in part.get("properties", {}).values():
            value["description"] = _MARKDOWN_LINK_PATTERN.sub(r"\1", value["description"])
    file_schema = schemas.pop(short_model_name(file_format.model.__name__))
    key = {"const": file_format.schema, "description": "The format of this file and its version."}
    file_schema["properties"] = {"schema": key} | file_schema["properties"]
    file_schema["required"] = ["schema", *file_schema["required"]]
    head = {"$schema": SCHEMA_DRAFT, "title": file_format.schema}
    return head | file_schema | ({"definitions": schemas} if schemas else {})


def _add_fault_models(injection: dict[str, Any], fault_models: FaultModels) -> None:
    properties = injection["properties"]
    properties["model"]["anyOf"] = [{"enum": [model.name for model in fault_models]}, {"type": "string"}]
    properties["unit"]["anyOf"] = [{"enum": _unit_names()}, {"type": "null"}]
    injection["allOf"] = [_parameters_rule(model) for model in fault_models]


def _unit_names() -> list[str]:
    symbols = (unit.symbol for unit in units.UNITS.values())
    return list(dict.fromkeys([*units.UNITS, units.DIMENSIONLESS, *symbols, "-"]))


def _parameters_rule(model: FaultModel) -> dict[str, Any]:
    condition = {"required": ["model"], "properties": {"model": {"const": model.name}}}
    patterns = {
        f"^({'|'.join(spec_keys_of_parameter(param))})$": _value_schema(param) | {"description": param.about}
        for param in model.params
        if param.type != "seed"
    }
    params = {"patternProperties": patterns, "additionalProperties": False}
    return {"if": condition, "then": {"properties": {"params": params}}}


def spec_keys_of_parameter(param: ParamSchema) -> Iterator[str]:
    """Yield the keys of a parameter in a spec, one for each possible unit."""
    if param.unit in (None, UNIT_OF_CHANGED_VARIABLE):
        yield param.name
    if param.unit is not None:
        default_unit = units.UNITS.get(param.unit)
        for unit in units.UNITS.values():
            if default_unit is None or unit.dimension == default_unit.dimension:
                yield f"{param.name}_{unit.suffix}"


def _value_schema(param: ParamSchema) -> dict[str, Any]:
    if param.type in NAME_PARAM_TYPES:
        return {"type": "string"}
    if param.type == "boolean":
        return {"type": "boolean"}
    if param.type in ("choice", "unit"):
        return {"enum": list(param.choices or units.UNITS)}
    other_types = [{"type": "boolean"}, {"type": "null"}] if param.type == "constant" else []
    return {"anyOf": [{"type": "number"}, {"type": "string"}, _DRAWN_VALUE_SCHEMA, *other_types]}
