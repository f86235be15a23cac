"""Regression files: experiments that were saved with what is expected of them."""

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import Field, TypeAdapter, ValidationError

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_name_not_path
from mutator._common.files import write_atomic
from mutator.campaigns.campaign_files import check_expectation
from mutator.campaigns.expectations import Expectation
from mutator.config.yaml_files import StrictModel, YamlRecord, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.store import plan_file
from mutator.store.plan_lines import (
    concrete_as_json,
    experiment_from_json,
    fault_from_json,
    with_stored_concrete,
)
from mutator.targets.hazard_severity import SeverityScale

SCHEMA = "regression/1"
_PARSE_ERRORS = (ValueError, LookupError, TypeError, AttributeError)
_TYPES: TypeAdapter[Experiment] = TypeAdapter(Experiment)


class SavedExperimentModel(StrictModel, title="A saved experiment"):
    """An experiment as the plan of its run had it."""

    about: str = Field("", description="What happened when it was saved.")
    expect: YamlRecord[Expectation] = Field(description="What its result may be.")
    experiment: dict[str, Any] = Field(description="The experiment.")
    fault: dict[str, Any] = Field(description="Its fault.")
    concrete: dict[str, Any] | None = Field(None, description="Its scenario, if a family gave it.")


class RegressionModel(StrictModel, title="The file"):
    """Saved experiments of one target."""

    target: str = Field(description="The name of the target's manifest.")
    experiments: list[SavedExperimentModel] = Field(min_length=1, description="The experiments.")


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedExperiment:
    """An experiment with what is expected of it, and its line in the file."""

    experiment: Experiment
    expectation: Expectation
    line: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RegressionFile:
    """A checked file of saved experiments, which all have one reading and one `after_hazard`."""

    path: Path
    target: str
    experiments: tuple[SavedExperiment, ...]
    source: YamlSource

    def bench_values(self) -> Mapping[str, Any]:
        """Return the values of the bench that runs the experiments."""
        first = self.experiments[0].experiment
        return {
            "name": "regressions",
            "about": f"Saved experiments of {self.path.name}.",
            "target": self.target,
            "reading": first.fault.reading,
            "seed": 0,
            "after_hazard": first.after_hazard.value,
        }

    def check_expectations(self, hazards: Collection[str], scale: SeverityScale | None) -> None:
        """Raise MutatorError if an experiment's `expect` names something that the target does not have."""
        for i, saved in enumerate(self.experiments):
            keys = ("experiments", i, "expect")
            check_expectation(saved.expectation, self.source, keys, hazards, scale)


def load_regressions(path: Path) -> RegressionFile:
    """Read a file of saved experiments strictly; any mistake raises MutatorError with file and line."""
    model, source = load_yaml_model(path, RegressionModel, SCHEMA)
    with source.locating_errors(("target",)):
        checked_name_not_path(model.target, path)
    saved: dict[str, SavedExperiment] = {}
    for i, entry in enumerate(model.experiments):
        experiment = _experiment_of(entry, source, i)
        if experiment.id in saved:
            raise source.error(
                ("experiments", i), f"experiment {experiment.id} again", remedy="remove one of them"
            )
        saved[experiment.id] = SavedExperiment(
            experiment=experiment,
            expectation=entry.expect,
            line=source.line_of(("experiments", i)),
        )
    loaded = RegressionFile(path=path, target=model.target, experiments=tuple(saved.values()), source=source)
    _check_one_kind(loaded)
    return loaded


def save_regression(
    path: Path, target: str, experiment: Experiment, expectation: Expectation, about: str
) -> RegressionFile:
    """Add an experiment to a file, which is made if there is none; return the file.

    MutatorError if the file has another target, or has the experiment.
    """
    text = f"schema: {SCHEMA}\ntarget: {_json(target)}\nexperiments:\n"
    if path.exists():
        earlier = load_regressions(path)
        if earlier.target != target:
            raise MutatorError(
                f"experiments of target {earlier.target}",
                where=path,
                expected=f"those of {target}",
                remedy="save into another file",
            )
        text = read_bounded(path).decode().rstrip("\n") + "\n"
    values = {name: value for name, value in asdict(expectation).items() if value is not None}
    entry = {
        "about": about,
        "expect": values,
        "experiment": plan_file.experiment_as_json(experiment),
        "fault": json.loads(plan_file.fault_line(experiment.fault)),
    }
    if experiment.concrete is not None:
        entry["concrete"] = concrete_as_json(experiment.concrete)
    lines = [f"{key}: {_json(value)}\n" for key, value in entry.items() if value != ""]
    before = read_bounded(path) if path.exists() else None
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, f"{text}  - {'    '.join(lines)}".encode())
    try:
        return load_regressions(path)
    except MutatorError:
        if before is None:
            path.unlink()
        else:
            write_atomic(path, before)
        raise


def _experiment_of(entry: SavedExperimentModel, source: YamlSource, number: int) -> Experiment:
    """Return the saved experiment; MutatorError if it is not what was saved."""
    try:
        _check_types(entry)
        fault = fault_from_json(entry.fault)
        experiment = experiment_from_json(entry.experiment, {fault.id: fault})
        return with_stored_concrete(experiment, {"concrete": entry.concrete} if entry.concrete else {})
    except (MutatorError, *_PARSE_ERRORS) as err:
        raise source.error(
            ("experiments", number),
            f"an experiment that was changed ({err})",
            expected="experiment and fault as they were saved",
            remedy="save it again (`mutator show ID --save FILE`)",
        ) from None


def _check_types(entry: SavedExperimentModel) -> None:
    """Raise ValueError if a value has a type that no plan has, even if the id matches."""
    values = {**entry.experiment, "fault": entry.fault}
    try:
        _TYPES.validate_json(json.dumps(values), strict=True)
    except ValidationError as err:
        first = err.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ValueError(f"{place}: {first['msg']}") from None


def _check_one_kind(loaded: RegressionFile) -> None:
    first = loaded.experiments[0].experiment
    for i, saved in enumerate(loaded.experiments):
        other = saved.experiment
        if (other.fault.reading, other.after_hazard) != (first.fault.reading, first.after_hazard):
            raise loaded.source.error(
                ("experiments", i),
                f"reading '{other.fault.reading}', after_hazard '{other.after_hazard.value}'",
                expected=f"'{first.fault.reading}', '{first.after_hazard.value}', as the first experiment",
                remedy="put it into a file of its own",
            )


def _json(value: Any) -> str:
    """Return a value on one line. JSON is YAML."""
    return json.dumps(value, allow_nan=False)
