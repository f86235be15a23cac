"""Check requests for jobs, and build their command lines.

A name must be in the library, and an id in a run's plan. No value can be a path or look like an option.
"""

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, TypeAdapter

from mutator._common.confined_files import check_only_plain_files
from mutator._common.cpu_cores import usable_cores
from mutator._common.library_and_run_folder_search import shrunk_folder
from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.campaigns.campaign_files import load_campaign
from mutator.campaigns.row_filters import compile_filter
from mutator.config.yaml_files import StrictModel
from mutator.errors import MutatorError
from mutator.families.family_facts import FamilyFacts
from mutator.results.plan_columns import plan_column_names
from mutator.serve.page_tokens import TRIAL_PAGE, live_page_name, run_page_name
from mutator.serve.served_runs import ServedRuns, report_address
from mutator.serve.served_trials import TRIALS_FOLDER, check_value_declared
from mutator.store import plan_file
from mutator.triggers.conditions import canonical_condition
from mutator.workspace import Workspace


def _check_plain_text(text: str) -> str:
    if not text.strip() or text.startswith("-") or not text.isprintable():
        raise ValueError("not plain text: empty, with a leading `-`, or with unprintable characters")
    return text


PlainText = Annotated[str, Field(max_length=500), AfterValidator(_check_plain_text)]
ExperimentId = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
Seed = Annotated[int, Field(ge=0, lt=2**63)]
FiniteNumber = Annotated[float, Field(allow_inf_nan=False)]


class RerunRequest(StrictModel):
    """Rerun an experiment. The kind `plot` also keeps an exact plot and the series."""

    kind: Literal["rerun", "plot"]
    run: PlainText
    experiment: ExperimentId


class FilmRequest(StrictModel):
    kind: Literal["film"]
    run: PlainText
    experiment: ExperimentId


class StillRequest(StrictModel):
    """Take one frame of the film, at `t` s."""

    kind: Literal["still"]
    run: PlainText
    experiment: ExperimentId
    t: Annotated[FiniteNumber, Field(ge=0, le=1e6)]


class ShrinkRequest(StrictModel):
    """Find the smallest fault with the hazard of an experiment."""

    kind: Literal["shrink"]
    run: PlainText
    experiment: ExperimentId


class ReportRequest(StrictModel):
    kind: Literal["report"]
    run: PlainText


class TrialRequest(StrictModel):
    """Inject one fault and run it once."""

    kind: Literal["try"]
    spec: PlainText
    scenario: PlainText
    trigger: PlainText = "always"
    variant: PlainText | None = None
    value: FiniteNumber | None = None
    seed: Seed | None = None
    reading: PlainText | None = None
    target: PlainText | None = None


class CampaignRequest(StrictModel):
    """Run part of a campaign in the new folder `name`, or all of one that explores: without `only`."""

    kind: Literal["campaign"]
    campaign: PlainText
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
    limit: Annotated[int, Field(ge=1, le=1000)] = 20
    proportional: bool = False
    only: PlainText | None = None
    seed: Seed | None = None
    workers: Annotated[int, Field(ge=1)] | None = None


ExperimentRequest = RerunRequest | FilmRequest | StillRequest | ShrinkRequest
JobRequest = ExperimentRequest | ReportRequest | TrialRequest | CampaignRequest
_REQUEST_ADAPTER: TypeAdapter[JobRequest] = TypeAdapter(Annotated[JobRequest, Field(discriminator="kind")])


@dataclass(frozen=True, slots=True, kw_only=True)
class JobCommand:
    """A checked request, with the arguments of its command line."""

    job_request: JobRequest
    title: str
    argv: tuple[str, ...]
    run_folder: Path | None = None
    requesting_page: str | None = None  # the page that can request it besides the first one (`page_tokens`)
    result_address: str | None = None  # the page with the result


@dataclass(frozen=True, slots=True)
class RequestChecker:
    workspace: Workspace
    runs: ServedRuns

    def build_command(self, body: bytes) -> JobCommand:
        """Check a request in JSON; MutatorError or ValidationError if it is invalid."""
        request = _REQUEST_ADAPTER.validate_json(body)
        builders: dict[type[Any], Callable[[Any], JobCommand]] = {
            RerunRequest: self._rerun_command,
            FilmRequest: self._film_command,
            StillRequest: self._still_command,
            ShrinkRequest: self._shrink_command,
            ReportRequest: self._report_command,
            TrialRequest: self._trial_command,
            CampaignRequest: self._campaign_command,
        }
        return builders[type(request)](request)

    def _rerun_command(self, request: RerunRequest) -> JobCommand:
        trace = ["--trace"] if request.kind == "plot" else []
        what = "exact plot" if trace else "rerun"
        return self._experiment_command(request, what, "rerun", request.experiment, *trace)

    def _film_command(self, request: FilmRequest) -> JobCommand:
        film = self.runs.folder(request.run) / "plots" / f"{request.experiment}.mp4"
        return self._experiment_command(request, "film", "show", request.experiment, f"--video={film}")

    def _still_command(self, request: StillRequest) -> JobCommand:
        what = f"picture at {request.t:.2f} s"
        return self._experiment_command(request, what, "show", request.experiment, f"--still={request.t:.2f}")

    def _shrink_command(self, request: ShrinkRequest) -> JobCommand:
        out = shrunk_folder(self.runs.folder(request.run), request.experiment)
        if _checked_new_folder(out) != out:
            raise MutatorError(f"{out.parent.name} is a link", expected="a folder", remedy="remove the link")
        command = self._experiment_command(
            request, "smallest form", "shrink", request.experiment, f"--out={out}"
        )
        return replace(command, result_address=None)  # known at the end: the result's

    def _experiment_command(self, request: ExperimentRequest, what: str, *arguments: str) -> JobCommand:
        folder = self._existing_run_folder(request.run)
        if request.experiment not in plan_file.experiment_ids(folder):
            raise MutatorError(
                f"no experiment '{request.experiment}'",
                where=request.run,
                expected="the id of an experiment in the run",
            )
        return JobCommand(
            job_request=request,
            title=f"{request.experiment} of {request.run}: {what}",
            argv=(*arguments, f"--run={folder}", *self._workspace_options()),
            run_folder=folder,
            requesting_page=run_page_name(folder),
            result_address=f"{report_address(request.run)}#e={request.experiment}",
        )

    def _report_command(self, request: ReportRequest) -> JobCommand:
        folder = self._existing_run_folder(request.run)
        arguments = ("report", str(folder), *self._workspace_options())
        title, result = f"report of {request.run}", report_address(request.run)
        return JobCommand(
            job_request=request,
            title=title,
            argv=arguments,
            run_folder=folder,
            requesting_page=run_page_name(folder),
            result_address=result,
        )

    def _trial_command(self, request: TrialRequest) -> JobCommand:
        spec = next((other for other in self.workspace.specs() if other.name == request.spec), None)
        if spec is None:
            raise _unknown_name_error("spec", request.spec, [other.name for other in self.workspace.specs()])
        variants = [variant.name for variant in spec]
        for what, requested, accepted in (
            ("scenario", request.scenario, self._accepted_scenarios(request.scenario)),
            ("variant", request.variant, variants),
            ("reading", request.reading, self.workspace.readings().names),
            ("target", request.target, self.workspace.targets),
        ):
            if requested is not None and requested not in accepted:
                raise _unknown_name_error(what, requested, accepted)
        self._check_trigger(request.trigger, request.target)
        if request.value is not None:
            check_value_declared(spec, request.variant, request.value)
        options = {
            "--scenario": request.scenario,
            "--trigger": request.trigger,
            "--variant": request.variant,
            "--value": request.value,
            "--seed": request.seed,
            "--reading": request.reading,
            "--manifest": request.target,
            "--out": self._new_folder(TRIALS_FOLDER),
        }
        arguments = ("try", request.spec, *_joined_options(options), *self._workspace_options())
        return JobCommand(
            job_request=request,
            title=f"{request.spec} in {request.scenario}, {request.trigger}",
            argv=arguments,
            requesting_page=TRIAL_PAGE,
        )

    def _accepted_scenarios(self, scenario: str) -> Collection[str]:
        """Return the scenarios of the library, and `scenario` if it is that of a family."""
        names = self.workspace.scenarios
        return [*names, scenario] if self.workspace.concrete_scenario(scenario) else names

    def _families_of(self, campaign: str) -> list[FamilyFacts]:
        """Return the families from which a campaign of the library draws scenarios."""
        selections = load_campaign(self.workspace.campaign(campaign)).scenario_selections
        return [self.workspace.family(item.family).facts for item in selections if not isinstance(item, str)]

    def _campaign_command(self, request: CampaignRequest) -> JobCommand:
        if request.campaign not in self.workspace.campaigns:
            raise _unknown_name_error("campaign", request.campaign, self.workspace.campaigns)
        if request.only is not None:
            compile_filter(request.only, plan_column_names(self._families_of(request.campaign)))
        folder = self._new_folder(request.name)
        self.runs.folders_by_key()  # the runs that are there come first
        if self.runs.reserved_key(folder) != request.name:
            # open pages of the other run would read the new one
            raise MutatorError(
                f"a run '{request.name}' in another folder",
                where="name",
                expected="a name that no served run has",
                remedy="choose another name",
            )
        explores = load_campaign(self.workspace.campaign(request.campaign)).exploration_request is not None
        if explores and request.only is not None:
            raise MutatorError(
                f"a filter for {request.campaign}, which explores",
                where="only",
                expected="no filter, because results decide which experiments follow",
            )
        options = {
            "--out": folder,
            "--limit": None if explores else request.limit,
            "--only": request.only,
            "--seed": request.seed,
            "--workers": min(request.workers or usable_cores(), usable_cores()),
        }
        return JobCommand(
            job_request=request,
            title=f"{request.campaign} into {request.name}",
            argv=(
                *("run", request.campaign, *_joined_options(options)),
                *(("--proportional",) if request.proportional and not explores else ()),
                *self._workspace_options(),
            ),
            run_folder=folder,
            requesting_page=live_page_name(folder),
        )

    def _check_trigger(self, text: str, target: str | None) -> None:
        tables = map(self.workspace.context_table, self.workspace.context_tables)
        names = {
            name for table in tables for row in table.rows for name in (row.id, f"{table.name}/{row.id}")
        }
        if text == "always" or text in names:
            return
        try:
            time = float(text)
        except ValueError:
            manifest = self.workspace.manifest(self.workspace.target_name(target))
            canonical_condition(text, None, manifest.observation.variables)
            return
        if not math.isfinite(time) or time < 0:
            raise MutatorError(f"'{text}'", where="trigger", expected="a finite time of at least 0 s")

    def _existing_run_folder(self, key: str) -> Path:
        """Return the run folder with this key; MutatorError if it contains links."""
        folder = self.runs.folder(key)
        check_only_plain_files(folder)
        return folder

    def _new_folder(self, name: str) -> Path:
        return _checked_new_folder(self.runs.folder_for_new_runs / name)

    def _workspace_options(self) -> list[str]:
        workspace = self.workspace
        options = {
            "--library": workspace.library,
            "--templates": workspace.templates,
            "--target": workspace.target,
        }
        return [*_joined_options(options), *(["--sandbox"] if workspace.sandbox else [])]


def _checked_new_folder(folder: Path) -> Path:
    """Return a folder for results, resolved; MutatorError if it is a link or contains links."""
    if folder.is_symlink():
        raise MutatorError(f"{folder.name} is a link", expected="a new folder", remedy="choose another name")
    if folder.is_dir():
        check_only_plain_files(folder)
    return folder.resolve()


def _joined_options(values_by_option: dict[str, Any]) -> list[str]:
    """Join options and values, so that no value is taken for an option."""
    return [f"{name}={value}" for name, value in values_by_option.items() if value is not None]


def _unknown_name_error(what: str, name: str, accepted: Collection[str]) -> MutatorError:
    return MutatorError(
        f"no {what} '{name}'",
        where=what,
        expected=describe_choices(accepted),
        remedy="correct the name" + spelling_suggestion(name, list(accepted)),
    )
