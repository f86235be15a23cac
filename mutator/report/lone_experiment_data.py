"""The data of one experiment for a page that shows it alone: a trial, or an experiment of an unfinished run.

web/trial/trial.js shows it in the report's view of an experiment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mutator._common.hashing import as_json_types
from mutator.families.family_facts import FamilyFacts
from mutator.mutants.patches_by_file import patch_without_new_files
from mutator.report.experiment_facts import RANK_COLUMN
from mutator.report.experiment_list_data import details_data, results_table_data
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.finished_experiments_and_columns import FinishedExperiment, ResultColumn
from mutator.results.plan_columns import PlanColumn
from mutator.results.severity_and_sentence_columns import severity_and_time_columns
from mutator.results.table_columns import deviation_column_by_channel, result_columns, result_columns_of
from mutator.results.table_reader import frame_of_finished
from mutator.review.patch_shapes import shapes_of_patches
from mutator.store.embedded_series import EmbeddedSeries
from mutator.store.run_folder import RunFolder
from mutator.targets.hazard_severity import SeverityScale
from mutator.targets.manifest import TargetManifest
from mutator.targets.overhead_view_json import scene_as_json
from mutator.targets.stored_phrases import Phrases
from mutator.targets.stored_target_facts import HazardFacts, MetricFacts, hazard_facts, metric_facts

_TRACE_DIGEST_DIGITS = 16
_MOST_SERIES_BYTES = 16_000_000  # of one experiment and its golden run, as text


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewedTarget:
    """What the view needs to know about the target of an experiment."""

    columns: Sequence[PlanColumn | ResultColumn]
    sentences: ExperimentSentences
    hazards: Sequence[HazardFacts]
    hazard_names: Sequence[str]
    metrics: Sequence[MetricFacts]
    compared: Sequence[str]
    scale: SeverityScale | None
    has_alerts: bool
    scene: dict[str, Any] | None
    families: Sequence[FamilyFacts] = ()

    @classmethod
    def of_run(cls, folder: RunFolder, manifest: TargetManifest | None) -> "ViewedTarget":
        """Return what a run stores about its target; `manifest` has only the scene of the replay."""
        head = folder.head
        return cls(
            columns=result_columns_of(folder),
            sentences=ExperimentSentences.of_run(head),
            hazards=head.about_hazards,
            hazard_names=head.hazards,
            metrics=head.metrics,
            compared=head.compared,
            scale=head.severity,
            has_alerts=bool(head.alerts),
            scene=scene_as_json(manifest) if manifest else None,
            families=head.families,
        )

    @classmethod
    def of_manifest(
        cls,
        manifest: TargetManifest,
        scale: SeverityScale | None,
        phrases: Phrases,
        families: Sequence[FamilyFacts],
    ) -> "ViewedTarget":
        compared, metrics = [channel.name for channel in manifest.compared_channels], metric_facts(manifest)
        severity = severity_and_time_columns(has_classes=scale is not None)
        return cls(
            columns=result_columns(
                manifest.hazard_names,
                compared,
                metrics,
                severity,
                families=families,
                speed=bool(manifest.speed),
            ),
            sentences=ExperimentSentences.of_target(manifest, phrases, scale),
            hazards=hazard_facts(manifest),
            hazard_names=manifest.hazard_names,
            metrics=metrics,
            compared=compared,
            scale=scale,
            has_alerts=bool(manifest.alerts),
            scene=scene_as_json(manifest),
            families=families,
        )


def experiment_view_data(
    target: ViewedTarget,
    finished: FinishedExperiment,
    patch: bytes | None,
    series: tuple[bytes, bytes] | None,
    reason_without_series: str,
) -> dict[str, Any]:
    """Return the table of one row, its details, facts about the target, and the encoded series."""
    experiment, record = finished.experiment, finished.record
    frame = frame_of_finished(target.columns, [finished], target.hazard_names, target.families)
    frame = frame.assign(**{RANK_COLUMN: 0})
    table = results_table_data(
        frame,
        {experiment.fault.id: experiment.fault},
        has_alerts=target.has_alerts,
        sentences=target.sentences,
    )
    del table["columns"][[column["name"] for column in table["columns"]].index("rank")]
    if target.scale:
        table["severities"] = target.scale.labels
    shown_patch = patch and patch_without_new_files(patch.decode("utf-8", "replace"))[0]
    shapes = shapes_of_patches([(experiment.id, "", shown_patch)] if shown_patch else [])
    embedded = EmbeddedSeries(_MOST_SERIES_BYTES)
    if series:
        embedded.add({experiment.id: series})
    return {
        "id": experiment.id,
        "table": table,
        "details": details_data(
            [experiment], shapes, [experiment.id], [record.trace_digest[:_TRACE_DIGEST_DIGITS]]
        ),
        "series": embedded.as_json(),
        "facts": {
            "filmed": False,
            "scene": target.scene,
            "series": {
                "deviations": dict(deviation_column_by_channel(target.compared)),
                "reason_if_missing": reason_without_series,
                "alone": {"unreadable": [], "last_rank": 1, "reason_beyond": ""},
            },
            "metrics": as_json_types(target.metrics),
            "severity": as_json_types(target.scale),
            "hazards": as_json_types(target.hazards),
            "meanings": {},
        },
    }
