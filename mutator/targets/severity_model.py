"""The severity of a manifest, and the scales of a library."""

from collections.abc import Sequence
from pathlib import Path

from pydantic import Field

from mutator.config.units import UNITS
from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_sources import YamlSource
from mutator.targets.contact_severity import SEVERITY_CLASSES, ContactSettings, SeverityScale
from mutator.targets.criteria import Hazard, Metric

SCHEMA = "severity/1"
_MPS_PER_KPH = UNITS["kph"].si_factor


class _SeverityClassModel(StrictModel, title="A class"):
    from_kph: float = Field(
        ge=0.0, allow_inf_nan=False, description="The smallest delta-v in the class; 0 for S0."
    )
    words: str = Field(
        "", description="The harm in a word or two, shown after the name of the class. Default: `about`."
    )
    about: str = Field(description="The harm in this class.")


class SeverityScaleModel(StrictModel, title="severity/*.yaml"):
    """The bounds of each class. A library can contain several scales."""

    about: str = Field("", description="The purpose of the scale.")
    source: str = Field(description="The source of the bounds.")
    classes: dict[str, _SeverityClassModel] = Field(
        description="The classes S0, S1, S2 and S3; each begins at a higher delta-v than the one before."
    )


def check_contact(
    contact: ContactSettings, hazards: Sequence[Hazard], metrics: Sequence[Metric], source: YamlSource
) -> None:
    """Raise MutatorError, with the line, for an unsuitable hazard or metric of a manifest's severity."""
    terminal = [hazard.name for hazard in hazards if hazard.terminal_condition]
    if contact.hazard not in terminal:
        raise source.error(
            ("severity", "contact"),
            f"'{contact.hazard}'",
            expected=f"a hazard with `terminal`: {', '.join(terminal) or 'there is none'}",
            remedy="correct the name, or add `terminal: true` to the hazard",
        )
    speeds = [m.name for m in metrics if m.aggregate == "at_end" and m.unit == "m/s"]
    if contact.speed_metric not in speeds:
        raise source.error(
            ("severity", "contact_speed"),
            f"'{contact.speed_metric}'",
            expected=f"a metric with `at_end` and the unit m/s: {', '.join(speeds) or 'there is none'}",
            remedy="correct the name, or add the metric",
        )


def load_severity_scale(path: Path) -> SeverityScale:
    """Read a scale of a library; MutatorError, with the line, unless the classes are S0 to S3 in order."""
    model, source = load_yaml_model(path, SeverityScaleModel, SCHEMA)
    if tuple(model.classes) != SEVERITY_CLASSES:
        raise source.error(
            ("classes",),
            f"the classes {', '.join(model.classes)}" if model.classes else "no classes",
            expected=f"{', '.join(SEVERITY_CLASSES)}, in this order",
            remedy="define each of these classes once",
        )
    lower_bounds = [model_class.from_kph for model_class in model.classes.values()]
    for i, name in enumerate(SEVERITY_CLASSES):
        if (i == 0 and lower_bounds[0] != 0.0) or (i and lower_bounds[i] <= lower_bounds[i - 1]):
            raise source.error(
                ("classes", name, "from_kph"),
                f"{lower_bounds[i]:g}",
                expected="0 for S0, and for each other class more than for the one before it",
                remedy="correct the bound",
            )
    return SeverityScale(
        name=path.stem,
        about=model.about,
        source=model.source,
        classes=tuple(
            (name, severity_class.from_kph * _MPS_PER_KPH, severity_class.about)
            for name, severity_class in model.classes.items()
        ),
        words=tuple(
            (name, severity_class.words)
            for name, severity_class in model.classes.items()
            if severity_class.words
        ),
    )
