"""Pages of the file formats: fault specs, campaigns, manifests, the hazard analysis."""

from collections.abc import Iterator

from mutator._common.tables import Table
from mutator.campaigns import campaign_files, campaign_model
from mutator.config import units
from mutator.execution.cluster import cluster_files
from mutator.faults import specs
from mutator.faults.readings import SCHEMA as READINGS_SCHEMA
from mutator.faults.readings import UNDECLARED, ReadingsModel
from mutator.reference.tables import generated, sections
from mutator.stpa import analysis, context_tables
from mutator.targets import manifest_files, severity
from mutator.workspace import Workspace

STRICT = """\
The YAML is plain: no tags, anchors or aliases, no key twice, `true` and `false` as the only booleans.
An unknown key, a wrong type, a unit of the wrong dimension or a value out of range is an error with file and
line. Numbers carry their unit in the last part of their key (`distance_m`, `by_kph`); a number without a unit
has a key without one.
"""
_SAME = (
    "The YAML is strict, as that of [fault specs](fault-spec.md), and "
    "[an editor can check it](../how-to/edit-with-completion.md)."
)


def fault_spec(workspace: Workspace) -> str:
    """docs/reference/fault-spec.md."""
    example = min((workspace.library / "faults").rglob("*.yaml")).read_text(encoding="utf-8")
    return _page(
        generated("Fault specs"),
        "A fault spec is one YAML file: a fault type of a module, in one or more variants. The "
        "library keeps it "
        "at\n`fault_library/faults/<module>/<fault_type>.yaml`; `mutator try FILE --scenario S1` "
        "takes one from "
        "anywhere.\n",
        STRICT,
        f"The first key is `schema: {specs.SCHEMA}`. A file of a newer schema is refused.\n"
        "[An editor can check it](../how-to/edit-with-completion.md) while you write.\n",
        f"```yaml\n{example.rstrip()}\n```\n",
        *sections("fault-spec.md", specs.spec_model(workspace.readings())),
        *_readings(),
        "## Units\n",
        *_units(),
        "## Fault models\n",
        "Offset, scale, stuck and so on, with their parameters and examples: [Fault "
        "models](fault-models.md).\n",
    )


def campaigns(workspace: Workspace) -> str:
    """docs/reference/campaign.md."""
    example = (workspace.library / "campaigns" / "quickstart.yaml").read_text(encoding="utf-8")
    return _page(
        generated("Campaigns"),
        "Which faults, in which scenarios, under which triggers, within which limits. The library keeps a "
        "campaign at\n`fault_library/campaigns/<name>.yaml`; `mutator run FILE --out DIR` takes one from "
        "anywhere.\n",
        f"The first key is `schema: {campaign_files.SCHEMA}`. {_SAME}\n",
        f"```yaml\n{example.rstrip()}\n```\n",
        "Its experiments are all combinations of the selected faults, scenarios, methods and "
        "contexts, of which a "
        "`sample` takes some.\nThe same file and options make the same plan everywhere.\n",
        *sections("campaign.md", campaign_model.CampaignModel),
    )


def manifests(workspace: Workspace) -> str:
    """docs/reference/target-manifest.md."""
    return _page(
        generated("Target manifests"),
        "All that the harness knows of a controller tree, at `fault_library/targets/<name>.yaml`. "
        "[Another controller tree](../how-to/add-a-target.md)\nsays how to write one; what the "
        "manifests of this "
        "library record is in [Channels](channels.md).\n",
        f"The first key is `schema: {manifest_files.SCHEMA}`. {_SAME}\n",
        *sections("target-manifest.md", manifest_files.ManifestModel),
        "## Scales of severity\n",
        "The files of `fault_library/severity/`: which class a delta-v is in, as [Verdicts](../explanation/"
        "verdicts.md#severity)\nsays. A manifest names one in `severity.scale`. The first key is `schema: "
        f"{severity.SCHEMA}`.\n",
        *sections("target-manifest.md", severity.ScaleModel, below=2),
    )


def hazard_analysis(workspace: Workspace) -> str:
    """docs/reference/hazard-analysis.md."""
    return _page(
        generated("Files of the hazard analysis"),
        "The files of `fault_library/stpa/`. [The hazard "
        "analysis](../explanation/hazard-analysis.md) says what "
        "they mean together,\n[Change the hazard analysis](../how-to/change-the-hazard-analysis.md) "
        "how to write "
        "them; `mutator stpa` prints and checks them.\n",
        f"{_SAME} The first key of each is `schema`, with the file's kind: "
        f"`{context_tables.HAZARDS_SCHEMA}`, `{context_tables.CONTEXT_SCHEMA}`,\n`control_structure/1`, "
        "`unsafe_control_actions/1`, `causal_factors/1`.\n",
        *sections(
            "hazard-analysis.md",
            context_tables.HazardsModel,
            context_tables.TableModel,
            analysis.StructureModel,
            analysis.UnsafeActionsModel,
            analysis.FactorsModel,
        ),
    )


def clusters(workspace: Workspace) -> str:
    """docs/reference/cluster-file.md."""
    return _page(
        generated("Cluster files"),
        "Which cluster `mutator run --cluster FILE.yaml` starts, and ends with the run. [Run on many "
        "machines](../how-to/run-on-many-machines.md)\nhas one [for Slurm](../how-to/clusters/slurm.yaml) "
        "and one [for Kubernetes](../how-to/clusters/kubernetes.yaml).\n",
        f"The first key is `schema: {cluster_files.SCHEMA}`. {_SAME}\n",
        *sections("cluster-file.md", cluster_files.ClusterModel),
        "Of the options, the run sets these itself, and refuses them: "
        f"{', '.join(f'`{name}`' for name in cluster_files.RESERVED)}.\n`security` is `true` or left out; "
        "`processes` is the number of `cores`, as a worker has one thread.\n",
    )


def _readings() -> Iterator[str]:
    yield "## Readings\n"
    yield (
        "The [readings](../explanation/concepts.md#readings) of a library are the keys under which its "
        "variants have injections.\n`fault_library/readings.yaml` declares them; a library without it has "
        f"{' and '.join(f'`{name}`' for name in UNDECLARED.names)}. "
        "The first is the\ndefault: every variant is written in it, and it "
        "holds where another is not written. The first key of the file is\n"
        f"`schema: {READINGS_SCHEMA}`.\n"
    )
    yield from sections("fault-spec.md", ReadingsModel, below=2)


def _units() -> Iterator[str]:
    rows = [(f"`_{unit.suffix}`", unit.symbol, unit.dimension) for unit in units.UNITS.values()]
    yield Table(heads=("suffix", "unit", "quantity"), rows=rows).as_markdown(escape=False)
    yield ""
    yield (
        "The longest suffix counts: `by_per_m` is `by` in 1/m. A number is converted between units of one "
        "quantity, by a factor.\ndegC and K also differ by an offset, so they are two quantities: give a "
        "number in the unit that the variable has.\n"
    )


def _page(*parts: str) -> str:
    return "\n".join(parts).rstrip() + "\n"
