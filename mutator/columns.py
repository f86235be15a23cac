"""Columns of the results table, and of the plan: what is known of an experiment before it runs."""

from mutator.model import Experiment

COLUMNS = (
    "experiment_id",
    "fault_id",
    "module",
    "fault_type",
    "reading",
    "value",
    "unit",
    "scenario",
    "method",
    "trigger",
    "seed",
    "status",
    "outcome",
    "activated",
    "t_activation",
    "activations",
    "manifested",
    "t_manifest",
    "h1",
    "t_h1",
    "h2",
    "t_h2",
    "h3",
    "t_h3",
    "alerts",
    "t_alert",
    "reaction_time",
    "max_dev_gas",
    "max_dev_brake",
    "max_dev_steer",
)
PLAN_COLUMNS = (*COLUMNS[:11], "variant", "aim", "condition")


def plan_row(experiment: Experiment) -> dict[str, object]:
    """`PLAN_COLUMNS` of one experiment: `variant` of the spec, `condition` that the trigger waits for."""
    fault, trigger = experiment.fault, experiment.trigger
    return {
        "experiment_id": experiment.id,
        "fault_id": fault.id,
        "module": fault.module,
        "fault_type": fault.fault_type,
        "reading": fault.reading,
        "value": fault.value,
        "unit": fault.unit,
        "scenario": experiment.scenario,
        "method": experiment.method.value,
        "trigger": trigger.name,
        "seed": experiment.seed,
        "variant": fault.spec.rpartition("/")[2],
        "aim": fault.aim,
        "condition": trigger.condition,
    }
