"""Experiments as a user asks for them: any value, start, hold, scenario and seed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mutator._common.argument_checks import check_number, check_whole_number
from mutator._common.message_text import describe_choices
from mutator.api.scenario_choice import (
    ScenarioLike,
    concrete_scenario_of,
    digest_of_library_scenario,
)
from mutator.api.target_and_fault_selection import (
    FaultLike,
    SelectedTarget,
    TriggerLike,
    WorkspaceLike,
)
from mutator.errors import MutatorError
from mutator.limits import MOST_LIMIT_OR_TIME
from mutator.model import AfterHazard, Experiment, Fault, Hold, Method, Trigger
from mutator.triggers.conditions import canonical_condition
from mutator.triggers.trigger_kinds import CONDITION_NAME, held_for, named_with_hold


def build_experiment(
    fault: FaultLike,
    scenario: ScenarioLike,
    trigger: TriggerLike = "always",
    *,
    value: float | None = None,
    hold_s: float | None = None,
    seed: int = 0,
    reading: str | None = None,
    armed_after_s: float | None = None,
    setting: Sequence[str] = (),
    after_hazard: AfterHazard | str = AfterHazard.GO_ON,
    beyond: bool = False,
    target: str | None = None,
    workspace: WorkspaceLike = None,
) -> Experiment:
    """Build an experiment, without running anything. It has the id that it has in a campaign (see `hold_s`).

    * `fault`, `value`, `trigger`, `target`: as for `build_mutant`; `armed_after_s` as for `try_fault`.
    * `beyond`: accept a value outside the range that the spec declares.
    * `hold_s`: how long the fault stays active after its trigger first fires, in s. The trigger's name then
      says it: `at 3 s for 2 s`. A campaign says so only if its list has several holds of the trigger; for the
      id of another one, take the trigger from its plan, and no `hold_s`.
    * `scenario`: a name in the library, or a family with values: `r157_deceleration:ego=60,gap=20`.
    * `setting`: changes of the scenario, which the manifest names.
    * `after_hazard`: `stop` ends the run at its first terminal hazard.

    MutatorError for an invalid argument.
    """
    return ExperimentBuilder(SelectedTarget.of(workspace, target)).build(
        fault,
        scenario,
        trigger,
        value=value,
        hold_s=hold_s,
        seed=seed,
        reading=reading,
        armed_after_s=armed_after_s,
        setting=setting,
        after_hazard=after_hazard,
        beyond=beyond,
    )


@dataclass(frozen=True)
class ExperimentBuilder:
    """Builds experiments for one target."""

    selected_target: SelectedTarget

    def build(
        self,
        fault: FaultLike,
        scenario: ScenarioLike,
        trigger: TriggerLike = "always",
        *,
        value: float | None = None,
        hold_s: float | None = None,
        seed: int = 0,
        reading: str | None = None,
        armed_after_s: float | None = None,
        setting: Sequence[str] = (),
        after_hazard: AfterHazard | str = AfterHazard.GO_ON,
        beyond: bool = False,
    ) -> Experiment:
        """Build an experiment: see `build_experiment`."""
        check_whole_number("seed", seed)
        chosen_fault = self.selected_target.fault(
            fault, value=value, seed=seed, reading=reading, beyond=beyond
        )
        chosen_trigger = self.selected_target.trigger(trigger, armed_after_s)
        self._check_condition(chosen_trigger)
        if chosen_trigger.name == CONDITION_NAME:  # campaigns name a listed condition by its text
            chosen_trigger = replace(chosen_trigger, name=chosen_trigger.condition)
        if hold_s is not None:
            chosen_trigger = _held_trigger(chosen_fault, chosen_trigger, hold_s)
        self._check_setting(setting)
        workspace = self.selected_target.workspace
        concrete = concrete_scenario_of(workspace, scenario)
        return Experiment(
            fault=chosen_fault,
            scenario=concrete.name if concrete else str(scenario),
            scenario_digest=concrete.digest
            if concrete
            else digest_of_library_scenario(workspace, str(scenario)),
            method=Method.GUIDED,
            trigger=chosen_trigger,
            seed=seed,
            setting=tuple(setting),
            after_hazard=checked_after_hazard(after_hazard),
            concrete=concrete,
        )

    def _check_condition(self, trigger: Trigger) -> None:
        try:
            canonical_condition(
                trigger.condition, variables=self.selected_target.manifest.observation.variables
            )
        except MutatorError as err:
            raise MutatorError(
                err.got, argument="trigger", expected=err.expected or "", remedy=err.remedy or "correct it"
            ) from None

    def _check_setting(self, setting: Sequence[str]) -> None:
        changes = self.selected_target.manifest.args_by_change
        if isinstance(setting, str) or not isinstance(setting, Sequence):
            raise MutatorError(repr(setting), argument="setting", expected="a list of changes")
        if len(set(setting)) < len(setting):
            raise MutatorError(f"{list(setting)}", argument="setting", expected="each change once")
        for change in setting:
            if change not in changes:
                raise MutatorError(
                    f"change '{change}'",
                    argument="setting",
                    expected=describe_choices(changes),
                    remedy="name a change of the target's manifest",
                )


def _held_trigger(fault: Fault, trigger: Trigger, hold_s: float) -> Trigger:
    check_number("hold_s", hold_s)
    if not 0.0 < hold_s <= MOST_LIMIT_OR_TIME:
        expected = f"a number of seconds above 0, at most {MOST_LIMIT_OR_TIME}"
        raise MutatorError(f"{hold_s}", argument="hold_s", expected=expected)
    if fault.hold not in (None, Hold.FOR):
        raise MutatorError(
            f"hold_s {hold_s:g}, but the spec of {fault.spec} declares the hold `{fault.hold.value}`",
            argument="hold_s",
            remedy="leave out `hold_s`, or remove `hold` from the spec",
        )
    return named_with_hold(held_for(trigger, hold_s))


def checked_after_hazard(after_hazard: AfterHazard | str) -> AfterHazard:
    """Return what the argument `after_hazard` names; MutatorError unless it is a choice."""
    try:
        return AfterHazard(after_hazard)
    except ValueError:
        expected = " or ".join(f"`{choice.value}`" for choice in AfterHazard)
        raise MutatorError(repr(after_hazard), argument="after_hazard", expected=expected) from None
