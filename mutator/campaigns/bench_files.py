"""`campaign.yaml` of a bench: what was fixed when it was opened. Its experiments come in batches."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_name_not_path
from mutator.campaigns.campaign_files import Campaign, load_campaign
from mutator.campaigns.campaign_model import Canary
from mutator.campaigns.campaign_triggers import EVERY_READING
from mutator.campaigns.exploration_section import ExplorationSection
from mutator.config.yaml_files import StrictModel, YamlRecord, load_yaml_model
from mutator.errors import MutatorError
from mutator.limits import Limits
from mutator.model import AfterHazard, GoldenClass, Method
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE

BENCH_SCHEMA = "bench/1"
EXPERIMENTS_PER_CHUNK = 100  # of a bench's plan: whatever its batches, the same experiments are together


class BenchModel(StrictModel, title="The file"):
    """What a bench fixes for all its batches."""

    name: str = Field(pattern=r"^[a-z0-9_]+$", description="The name: lowercase letters, digits and `_`.")
    about: str = Field(description="The purpose of the bench.")
    target: str = Field(description="The name of the target's manifest.")
    reading: str = Field(description="The reading of all faults; empty in a library without readings.")
    seed: int = Field(ge=0, lt=2**63, description="The seed that decides what the equivalence check draws.")
    after_hazard: Annotated[AfterHazard, Field(strict=False)] = Field(
        AfterHazard.GO_ON, description="Whether runs end at their first terminal hazard (`stop`)."
    )
    include: Literal["hazard_without_fault"] | None = Field(None, description="As in a campaign.")
    canary: YamlRecord[Canary] | None = Field(None, description="As in a campaign.")
    limits: YamlRecord[Limits] = Field(Limits(), description="As in a campaign.")
    explore: YamlRecord[ExplorationSection] | None = Field(
        None, description="What is explored; without it, others decide what comes in each batch."
    )


def bench_file_bytes(values: Mapping[str, Any]) -> bytes:
    """Return the file with these values. JSON is YAML, one key a line. MutatorError for a value that JSON
    does not have, such as a number of numpy.
    """
    return "".join(
        f"{key}: {_json(key, value)}\n" for key, value in {"schema": BENCH_SCHEMA, **values}.items()
    ).encode()


def _json(key: str, value: Any) -> str:
    try:
        return json.dumps(value, allow_nan=False)
    except (TypeError, ValueError) as err:
        raise MutatorError(
            f"{value!r} ({err})", argument=key, expected="plain numbers, text, lists and mappings"
        ) from None


@contextmanager
def naming_arguments(path: Path, values: Mapping[str, Any]) -> Iterator[None]:
    """Make errors that point at a line of the bench's file name the argument in this line: whoever opened the
    bench did not write the file.
    """
    try:
        yield
    except MutatorError as error:
        if error.where != str(path) or error.line is None:
            raise
        key_by_line = dict(enumerate(("schema", *values), start=1))
        raise MutatorError(
            error.got, argument=key_by_line[error.line], expected=error.expected, remedy=error.remedy
        ) from None


def load_bench_file(path: Path) -> Campaign:
    """Read the file strictly; any mistake raises MutatorError with file and line."""
    model, source = load_yaml_model(path, BenchModel, BENCH_SCHEMA)
    with source.locating_errors(("target",)):
        checked_name_not_path(model.target, path)
    return Campaign(
        name=model.name,
        purpose=model.about.strip(),
        study=None,
        path=path,
        file_bytes=read_bounded(path),
        target=model.target,
        scenario_selections=(),
        changes_by_reading={EVERY_READING: ()},
        fault_selections=(),
        reading=model.reading,
        methods=tuple(Method),
        context_table=None,
        context_ids=None,
        listed_triggers=(),
        armed_after_s_by_reading={},
        random_until_s=None,
        hold_s=None,
        sample_size=None,
        is_sample_proportional=False,
        seeds=range(model.seed, model.seed + 1),
        canary=model.canary,
        limits=model.limits,
        chunk_size=EXPERIMENTS_PER_CHUNK,
        after_hazard=model.after_hazard,
        yaml_source=source,
        include=GoldenClass(model.include) if model.include else None,
        is_bench=True,
        exploration=model.explore,
    )


def load_campaign_of_run(folder: RunFolder) -> Campaign:
    """Read the campaign of a run folder, or what its bench fixed."""
    load = load_bench_file if folder.is_bench else load_campaign
    return load(folder.path / CAMPAIGN_FILE)
