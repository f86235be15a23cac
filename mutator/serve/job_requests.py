"""Check requests for jobs, and build their command lines.

A name must be in the library, and an id in a run's plan. No value can be a path or look like an option.
"""

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, TypeAdapter

from mutator._common.confined_files import check_only_plain_files
from mutator._common.cpu_cores import usable_cores
from mutator._common.message_text import describe_choices, suggestion
from mutator.campaigns.filters import compile_filter
from mutator.config.yaml_files import StrictModel
from mutator.errors import MutatorError
from mutator.results.plan_columns import PLAN_COLUMN_NAMES
from mutator.serve.served_runs import Runs, report_of
from mutator.store import plan_file
from mutator.triggers.conditions import canonical_condition
from mutator.workspace import Workspace


def _plain(text: str) -> str:
    if not text.strip() or text.startswith("-") or not text.isprintable():
        raise ValueError("not plain text: empty, with a leading `-`, or with unprintable characters")
    return text


TRIES = "try"  # folder of the results of `try`, next to the runs
Text = Annotated[str, Field(max_length=500), AfterValidator(_plain)]
ExperimentId = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
Seed = Annotated[int, Field(ge=0, lt=2**63)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class Rerun(StrictModel):
    """Rerun an experiment. The kind `plot` also keeps an exact plot and the series."""

    kind: Literal["rerun", "plot"]
    run: Text
    experiment: ExperimentId


class Film(StrictModel):
    kind: Literal["film"]
    run: Text
    experiment: ExperimentId


class Still(StrictModel):
    """Take one frame of the film, at `t` s."""

    kind: Literal["still"]
    run: Text
    experiment: ExperimentId
    t: Annotated[Finite, Field(ge=0, le=1e6)]


class Report(StrictModel):
    kind: Literal["report"]
    run: Text


class Try(StrictModel):
    """Inject one fault and run it once."""

    kind: Literal["try"]
    spec: Text
    scenario: Text
    trigger: Text = "always"
    variant: Text | None = None
    value: Finite | None = None
    seed: Seed | None = None
    reading: Text | None = None
    target: Text | None = None


class Campaign(StrictModel):
    """Run part of a campaign in the new folder `name`."""

    kind: Literal["campaign"]
    campaign: Text
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
    limit: Annotated[int, Field(ge=1, le=1000)] = 20
    only: Text | None = None
    seed: Seed | None = None
    workers: Annotated[int, Field(ge=1)] | None = None


Order = Rerun | Film | Still | Report | Try | Campaign
_ORDERS: TypeAdapter[Order] = TypeAdapter(Annotated[Order, Field(discriminator="kind")])


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """A checked request, with the arguments of its command line (`words`)."""

    order: Order
    title: str
    words: tuple[str, ...]
    folder: Path | None = None
    run: Path | None = None  # the run whose report can request it
    result: str | None = None  # the page with the result


@dataclass(frozen=True, slots=True)
class Desk:
    workspace: Workspace
    runs: Runs

    def work(self, body: bytes) -> Work:
        """Check a request in JSON; MutatorError or ValidationError if it is invalid."""
        order = _ORDERS.validate_json(body)
        makers: dict[type[Any], Callable[[Any], Work]] = {
            Rerun: self._rerun,
            Film: self._film,
            Still: self._still,
            Report: self._report,
            Try: self._try,
            Campaign: self._campaign,
        }
        return makers[type(order)](order)

    def _rerun(self, order: Rerun) -> Work:
        trace = ["--trace"] if order.kind == "plot" else []
        what = "exact plot" if trace else "rerun"
        return self._of_experiment(order, what, "rerun", order.experiment, *trace)

    def _film(self, order: Film) -> Work:
        film = self.runs.folder(order.run) / "plots" / f"{order.experiment}.mp4"
        return self._of_experiment(order, "film", "show", order.experiment, f"--video={film}")

    def _still(self, order: Still) -> Work:
        what = f"picture at {order.t:.2f} s"
        return self._of_experiment(order, what, "show", order.experiment, f"--still={order.t:.2f}")

    def _of_experiment(self, order: Rerun | Film | Still, what: str, *words: str) -> Work:
        folder = self._folder(order.run)
        if order.experiment not in plan_file.ids(folder):
            raise MutatorError(
                f"no experiment '{order.experiment}'",
                where=order.run,
                expected="the id of an experiment in the run",
            )
        return Work(
            order=order,
            title=f"{order.experiment} of {order.run}: {what}",
            words=(*words, f"--run={folder}", *self._place()),
            folder=folder,
            run=folder,
            result=f"{report_of(order.run)}#e={order.experiment}",
        )

    def _report(self, order: Report) -> Work:
        folder = self._folder(order.run)
        words = ("report", str(folder), *self._place())
        title, result = f"report of {order.run}", report_of(order.run)
        return Work(order=order, title=title, words=words, folder=folder, run=folder, result=result)

    def _try(self, order: Try) -> Work:
        spec = next((one for one in self.workspace.specs() if one.name == order.spec), None)
        if spec is None:
            raise _unknown("spec", order.spec, [one.name for one in self.workspace.specs()])
        variants = [variant.name for variant in spec]
        for what, given, known in (
            ("scenario", order.scenario, self.workspace.scenarios),
            ("variant", order.variant, variants),
            ("reading", order.reading, self.workspace.readings().names),
            ("target", order.target, self.workspace.targets),
        ):
            if given is not None and given not in known:
                raise _unknown(what, given, known)
        self._check_trigger(order.trigger, order.target)
        given_options = {
            "--scenario": order.scenario,
            "--trigger": order.trigger,
            "--variant": order.variant,
            "--value": order.value,
            "--seed": order.seed,
            "--reading": order.reading,
            "--manifest": order.target,
            "--out": self._new(TRIES),
        }
        words = ("try", order.spec, *_options(given_options), *self._place())
        return Work(order=order, title=f"{order.spec} in {order.scenario}, {order.trigger}", words=words)

    def _campaign(self, order: Campaign) -> Work:
        if order.campaign not in self.workspace.campaigns:
            raise _unknown("campaign", order.campaign, self.workspace.campaigns)
        if order.only is not None:
            compile_filter(order.only, PLAN_COLUMN_NAMES)
        folder = self._new(order.name)
        given_options = {
            "--out": folder,
            "--limit": order.limit,
            "--only": order.only,
            "--seed": order.seed,
            "--workers": min(order.workers or usable_cores(), usable_cores()),
        }
        return Work(
            order=order,
            title=f"{order.campaign} into {order.name}",
            words=("run", order.campaign, *_options(given_options), *self._place()),
            folder=folder,
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

    def _folder(self, key: str) -> Path:
        """Return the run folder with this key; MutatorError if it contains links."""
        folder = self.runs.folder(key)
        check_only_plain_files(folder)
        return folder

    def _new(self, name: str) -> Path:
        folder = self.runs.new / name
        if folder.is_symlink():
            raise MutatorError(f"{name} is a link", expected="a new folder", remedy="choose another name")
        if folder.is_dir():
            check_only_plain_files(folder)
        return folder.resolve()

    def _place(self) -> list[str]:
        place = self.workspace
        options = {"--library": place.library, "--templates": place.templates, "--target": place.target}
        return [*_options(options), *(["--sandbox"] if place.sandbox else [])]


def _options(given: dict[str, Any]) -> list[str]:
    """Join options and values, so that no value is taken for an option."""
    return [f"{name}={value}" for name, value in given.items() if value is not None]


def _unknown(what: str, name: str, known: Collection[str]) -> MutatorError:
    return MutatorError(
        f"no {what} '{name}'",
        where=what,
        expected=describe_choices(known),
        remedy="correct the name" + suggestion(name, list(known)),
    )
