"""Which experiments of a campaign are planned: samples, filters and limits."""

from dataclasses import dataclass

from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.row_filters import matching_items
from mutator.campaigns.sampling import draw_balanced, draw_balanced_pairs, draw_in_proportion
from mutator.errors import MutatorError
from mutator.families.family_facts import FamilyFacts
from mutator.model import Experiment
from mutator.results.plan_columns import columns_of_plan, plan_column_names, plan_row
from mutator.store.plan_choices import Choices
from mutator.store.plan_strata import PlanStrata, SampleDraw


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentChoice:
    """The sample of a campaign file, then the filters and the limit of the options."""

    campaign: Campaign
    choices: Choices
    families: tuple[FamilyFacts, ...]

    def choose(
        self, experiments: tuple[Experiment, ...], seed: int, most_experiments: int | None
    ) -> tuple[Experiment, ...]:
        """Return the experiments of one seed that are planned. MutatorError for too small a sample."""
        if self.campaign.sample_size is not None:
            experiments = self._sample(experiments, self.campaign.sample_size, seed)
        experiments = self._matching(experiments)
        if most_experiments is None:
            return experiments
        if not self.choices.proportional:
            return draw_balanced_pairs(experiments, most_experiments, seed)
        try:
            return draw_in_proportion(experiments, most_experiments, seed)
        except ValueError as err:
            raise MutatorError(
                str(most_experiments),
                argument="limit",
                expected=f"{err}, because a proportional draw takes at least one pair of guided and random "
                "experiments, or one experiment, of each fault type in each scenario",
                remedy="correct the number, or leave out `proportional`",
            ) from None

    def strata_before_draw(
        self, experiments: tuple[Experiment, ...], chosen: tuple[Experiment, ...]
    ) -> PlanStrata | None:
        """Return the strata of all experiments that match the filters; None if all of them are chosen."""
        has_sample, has_limit = self.campaign.sample_size is not None, self.choices.limit is not None
        if not (has_sample or has_limit):
            return None
        experiments = self._matching(experiments)
        if len(experiments) == len(chosen):
            return None
        is_even = (has_limit and not self.choices.proportional) or (
            has_sample and not self.campaign.is_sample_proportional
        )
        return PlanStrata.of_experiments(SampleDraw.EVEN if is_even else SampleDraw.PROPORTIONAL, experiments)

    def _sample(self, experiments: tuple[Experiment, ...], count: int, seed: int) -> tuple[Experiment, ...]:
        if not self.campaign.is_sample_proportional:
            return draw_balanced(experiments, count, seed)
        try:
            return draw_in_proportion(experiments, count, seed)
        except ValueError as err:
            raise self.campaign.error(
                ("sample",), f"sample {count}", expected=str(err), remedy="correct the number"
            ) from None

    def _matching(self, experiments: tuple[Experiment, ...]) -> tuple[Experiment, ...]:
        columns = columns_of_plan(self.families)
        for text, selects in ((self.choices.only, True), (self.choices.exclude, False)):
            if text is not None:
                experiments = tuple(
                    matching_items(
                        experiments,
                        text,
                        plan_column_names(self.families),
                        lambda experiment: plan_row(experiment, columns),
                        keeps_matches=selects,
                    )
                )
        return experiments
