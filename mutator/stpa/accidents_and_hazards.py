"""The accidents and hazards of the hazard analysis."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource

HAZARDS_SCHEMA = "hazards/1"


@dataclass(frozen=True, kw_only=True)
class HazardList:
    """Accidents and hazards (id -> description), and the accidents that each hazard can cause."""

    source: YamlSource
    accidents: Mapping[str, str]
    hazards: Mapping[str, str]
    accidents_by_hazard: Mapping[str, tuple[str, ...]]


class _HazardEntryModel(StrictModel, title="A hazard"):
    about: str = Field(description="What the hazard is.")
    leads_to: list[str] = Field(description="The accidents that it can cause.")


class HazardsModel(StrictModel, title="hazards.yaml"):
    """Accidents, and the hazards that can lead to them."""

    accidents: dict[str, str] = Field(description="Id -> description.")
    hazards: dict[str, _HazardEntryModel] = Field(description="Id -> hazard.")


def load_hazard_list(path: Path) -> HazardList:
    """Read accidents and hazards; MutatorError if a hazard names an unknown accident."""
    model, source = load_yaml_model(path, HazardsModel, HAZARDS_SCHEMA)
    for name, hazard in model.hazards.items():
        for i, accident in enumerate(hazard.leads_to):
            if accident not in model.accidents:
                raise source.error(
                    ("hazards", name, "leads_to", i),
                    f"accident '{accident}'",
                    expected=f"one of {', '.join(model.accidents)}",
                    remedy="correct the name, or add the accident to `accidents`",
                )
    return HazardList(
        source=source,
        accidents=dict(model.accidents),
        hazards={name: hazard.about for name, hazard in model.hazards.items()},
        accidents_by_hazard={name: tuple(hazard.leads_to) for name, hazard in model.hazards.items()},
    )
