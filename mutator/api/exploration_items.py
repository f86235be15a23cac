"""A campaign that explores, in a user's pytest session: an item for each location of a fault.

Results decide what is driven next, in all planes together. So the first item runs the whole exploration, on
one bench of the process that is no worker; each item then says how the planes of its location ended.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path

from mutator._common.cache_layout_and_pruning import campaign_runs_folder
from mutator._common.confined_files import path_below
from mutator._common.hashing import as_json_types, content_id
from mutator.api.exploration_benches import experiment_builder
from mutator.api.exploring_campaigns import ExploringCampaign
from mutator.campaigns.campaign_files import load_campaign
from mutator.campaigns.exploration_section import ExploredPlane
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError
from mutator.execution.campaign_runs import FileRun
from mutator.execution.item_running import FinishedItems, ItemEnding, ItemsStart
from mutator.execution.listed_items import ItemListing, ListedItem, is_marker
from mutator.execution.session_items import options_of_workspace
from mutator.execution.session_summary import Summary
from mutator.execution.spec_places import SpecPlaces
from mutator.execution.unexpected_results import replay_command
from mutator.explore.envelope_failures import first_failure
from mutator.explore.envelope_texts import describe_envelope, describe_finding
from mutator.explore.exploration_replay import ExplorationReplay, replay_exploration
from mutator.explore.finding_search import FindingSearch


class ExplorationRun(FileRun):
    """The exploration of a campaign's file."""

    deals_work = True

    @cached_property
    def _exploring(self) -> ExploringCampaign:
        return ExploringCampaign.of_campaign(self._workspace, load_campaign(self.path))

    def _list_items(self) -> ItemListing:
        planes = self._exploring.section.planes
        places = SpecPlaces(self._workspace, self._exploring.campaign)
        return ItemListing(
            items=tuple(
                ListedItem(
                    name=spec,
                    positions=(),
                    golden_key="",  # all work is done before the first item ends
                    markers=tuple(dict.fromkeys(filter(is_marker, _words_of(spec, planes)))),
                    place=places.place_of_variant(spec),
                )
                for spec in dict.fromkeys(plane.spec for plane in planes)
            )
        )

    def _begin_in(self, out: Path) -> None:
        for name in ("reviewed", "accept_versions"):
            if getattr(self._options, name):
                option = "--require-reviewed" if name == "reviewed" else "--accept-versions"
                raise MutatorError(
                    f"{option} with a campaign that explores", where=self.path, remedy=f"leave out {option}"
                )
        self._run = self._exploring.run(
            out,
            workers=max(1, self._options.workers),
            reuse=self._options.reuse,
            cluster=self._options.cluster,
            insecure_network=self._options.insecure_network,
            progress=self._notify,
        )

    def _items_start(self, name: str) -> ItemsStart:
        return ItemsStart(endings=self._endings)

    def _begin(self) -> FinishedItems:
        self.begin()
        return FinishedItems(self._endings)

    def _finish(self, *, is_stopped: bool) -> Summary | None:
        return self._run.summary

    def result_lines(self, summary: Summary) -> Sequence[str]:
        """Return what is survived of each plane, or how many findings there are."""
        replay = self._replay
        if isinstance(replay.exploration, FindingSearch):
            planes = replay.exploration.section.planes
            return [describe_finding(f, planes[f.plane]) for f in replay.exploration.findings()]
        return [describe_envelope(envelope) for envelope in replay.envelopes]

    @cached_property
    def _replay(self) -> ExplorationReplay:
        return replay_exploration(self._run.folder, self._run.manifest)

    @cached_property
    def _endings(self) -> dict[str, ItemEnding]:
        return {
            item.name: ItemEnding(
                problems=list(self._hazards_of(item.name)) if self._options.hazard_fails else ()
            )
            for item in self.listing.items
        }

    def _hazards_of(self, spec: str) -> Iterator[str]:
        """Yield what is not survived, and a run that shows it, for each plane of a location with a hazard."""
        replay = self._replay
        if isinstance(replay.exploration, FindingSearch):
            for finding in replay.exploration.findings():
                plane = replay.exploration.section.planes[finding.plane]
                if plane.spec == spec:
                    yield self._with_replay(describe_finding(finding, plane), finding.result.experiment_id)
        for envelope in replay.envelopes:
            if envelope.plane.spec == spec and (failure := first_failure(envelope)) is not None:
                yield self._with_replay(describe_envelope(envelope), failure.result.experiment_id)

    def _with_replay(self, text: str, experiment_id: str) -> str:
        options = options_of_workspace(self._workspace)
        return f"{text}\nreplay: {replay_command(self._run.folder, experiment_id, options)}"

    def _default_run_folder(self) -> Path:
        exploring = self._exploring
        reading, observe_s = exploring.values["reading"], exploring.section.observe_s
        build = experiment_builder(exploring.selected_target, reading, observe_s)
        experiments = [
            build(plane, (*plane.magnitudes, None)[0], 0.0, plane.durations_s[0])
            for plane in exploring.section.planes
        ]
        inputs = RunInputs.of_experiments(self._workspace, exploring.selected_target.manifest, experiments)
        key = content_id(
            [as_json_types(exploring.section), [e.id for e in experiments], *self._key_of_sources(inputs)]
        )
        return path_below(campaign_runs_folder(), f"{exploring.campaign.name}-{key}")


def _words_of(spec: str, planes: Sequence[ExploredPlane]) -> list[str]:
    """Return module and fault type of a variant, and the scenarios of its planes."""
    module, fault_type, _ = spec.split("/")
    return [module, fault_type, *(plane.scenario for plane in planes if plane.spec == spec)]
