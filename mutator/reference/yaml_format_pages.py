"""Generate the pages of the file formats."""

from collections.abc import Iterator

from mutator._common.table_rendering import TextTable
from mutator.campaigns import campaign_files, campaign_model
from mutator.config import units
from mutator.defences import defence_yaml
from mutator.execution.cluster import cluster_files
from mutator.families import family_yaml
from mutator.faults import fault_specs
from mutator.faults.library_readings import SCHEMA as READINGS_SCHEMA
from mutator.faults.library_readings import ReadingsModel
from mutator.reference.family_drives import COLOUR_NAMES, drawn_scenarios
from mutator.reference.yaml_key_tables import generated_page_head, model_sections
from mutator.stpa import accidents_and_hazards, context_tables, hazard_analysis_yaml
from mutator.targets import manifest_files, severity_yaml
from mutator.workspace import Workspace

STRICT_YAML_NOTE = """\
Use plain YAML: no tags, anchors or aliases, no duplicate keys, only `true` and `false` as booleans. Unknown
keys, wrong types, units of the wrong dimension and values out of range are errors with file and line. The
last part of a number's key is its unit (`distance_m`, `by_kph`). A number without a unit has a key without
one.
"""
_STRICT_YAML_LINKS = (
    "The YAML is as strict as in [fault specs](fault-spec.md), and "
    "[your editor can check it](../how-to/edit-with-completion.md)."
)

_DEFENCE_RULES = """\
## When it acts

In each step of a run, at the manifest's `actuation`, a defence reads its sensed values: ground truth of
this step, or values of the controller, each with the delay and noise of the file. While `acts_when` has
held for `acts_after_s`, it becomes active; while `lets_go_when` has held for `lets_go_after_s`, it ends.
Changed commands reach the plant with the next step, so a defence is one step late.

While active, its model gives ranges for commands, and each command is clamped to its range. A command that is
NaN, or infinite where its range has no bound, is replaced by the value that reached the plant in the step
before (0 if that is not finite), in its range. With several
defences, that of the highest `priority` comes last and decides. A defence *acts* in a step in which a
command that reaches the plant differs from the controller's by more than the command's `tolerance` because
of it. Several such steps in a row are one *activation*. Two defences are in *conflict* in a step in which
their ranges for a command do not overlap.

## The model

A model uses only public functions of a few modules of the standard library, and no clock, file or shared
random state. Its source is checked for that, which keeps honest mistakes out; it is no sandbox. It
is one class:

```python
class Model:
    def __init__(self, *, deceleration): ...  # parameters of the defence, by name
    def reset(self): ...  # at the start of a run, and whenever the defence lets go
    def update(self, since_s, sensed, applied): ...
```

`update` is called in each step in which the defence is active. `since_s` is the time since it became
active, `sensed` has the sensed and derived values, `applied` the commands that reached the plant in the
step before. It returns the range of each command that it changes: `{"torque": (0.5, inf)}` is at least half,
`(x, x)` exactly x.

## In the tree

A defended tree is the target's tree with the runtime `_fd.py`, a copy of each model, `_fd_<name>.py`, and
lines with the tag `# fd:`. Places of faults are found in the target's own text, without these lines.
"""


def render_fault_spec_page(workspace: Workspace) -> str:
    example = min((workspace.library / "faults").rglob("*.yaml")).read_text(encoding="utf-8")
    return _join_page(
        generated_page_head("Fault specs"),
        "A fault spec is one YAML file with a fault type of a module, in one or more variants. Its "
        "place in the "
        "library is\n`fault_library/faults/<module>/<fault_type>.yaml`. `mutator try FILE --scenario "
        "S1` accepts a file with any path.\n",
        STRICT_YAML_NOTE,
        f"The first key is `schema: {fault_specs.SCHEMA}`. Files with a newer schema are rejected.\n"
        "[Your editor can check the file](../how-to/edit-with-completion.md) while you write.\n",
        f"```yaml\n{example.rstrip()}\n```\n",
        *model_sections("fault-spec.md", fault_specs.build_spec_model(workspace.readings())),
        *_readings_section(),
        "## Units\n",
        *_units_table(),
        "## Fault models\n",
        "[Fault models](fault-models.md) lists all models (offset, scale, stuck, ...) with their "
        "parameters and examples.\n",
    )


def render_campaigns_page(workspace: Workspace) -> str:
    example = (workspace.library / "campaigns" / "quickstart.yaml").read_text(encoding="utf-8")
    return _join_page(
        generated_page_head("Campaigns"),
        "A campaign file chooses faults, scenarios, triggers and limits. Its place in the library is\n"
        "`fault_library/campaigns/<name>.yaml`. `mutator run FILE --out DIR` accepts a file with any path.\n",
        f"The first key is `schema: {campaign_files.SCHEMA}`. {_STRICT_YAML_LINKS}\n",
        f"```yaml\n{example.rstrip()}\n```\n",
        "The experiments are all combinations of the selected faults, scenarios, methods and "
        "contexts; `sample` "
        "draws some of them.\nThe same file and options produce the same plan everywhere.\n",
        *model_sections("campaign.md", campaign_model.CampaignModel),
    )


def render_families_page(workspace: Workspace) -> str:
    example = min((workspace.library / "families").glob("*.yaml")).read_text(encoding="utf-8")
    return _join_page(
        generated_page_head("Families of scenarios"),
        "A family is a scenario with parameters (ISO 34501 calls it a logical scenario). Its place in the "
        "library is\n`fault_library/families/<name>.yaml`. Campaigns draw concrete scenarios from it: "
        "`scenarios: [{family: NAME, sample: 100}]`.\n`mutator try SPEC --scenario NAME:ego=60,gap=20` "
        "drives one.\n",
        f"The first key is `schema: {family_yaml.FAMILY_SCHEMA}`. {_STRICT_YAML_LINKS}\n",
        f"```yaml\n{example.rstrip()}\n```\n",
        "A concrete scenario is the rendered template. Its name is that of the family and the first 12 "
        "digits of\nthe text's digest. A run folder has the texts of all scenarios of its plan.\n",
        *model_sections("family.md", family_yaml.FamilyModel),
        "## The template\n",
        "The template is text in the target's own format, with [Jinja](https://jinja.palletsprojects.com) "
        "expressions in `{{ }}`, conditions\nin `{% if %}` and loops in `{% for %}`. Numbers are written "
        "with at most nine decimals. Like all templates, it is\n[restricted](../explanation/trust.md): it "
        "reads no files, calls no functions and ends soon.\n",
        "## Sampling\n",
        "| method | scenarios |\n|---|---|\n"
        "| `grid` | all combinations of values that meet the constraints, or so many of them, evenly spread "
        "in the order of the file |\n"
        "| `random` | drawn independently |\n"
        "| `latin_hypercube` | each parameter's range is cut into as many equal parts as there are "
        "scenarios, and each part is used once |\n"
        "| `sobol` | the Sobol sequence, shifted by a random vector |\n",
        "All but `grid` follow the parameters' distributions and depend on the plan's first seed. A draw "
        "that breaks a constraint, or that is\nalready there, is replaced by the next. The first scenarios "
        "of `random` and `sobol` are the same for each `sample`.\n",
        "## The families of this library\n",
        "[What the controller does without faults](../explanation/fault-free-drives.md) shows how they are "
        "driven.\nEach drawing shows what is observed in three drives without faults, over time.\n",
        *_families_of_library(workspace),
    )


def _families_of_library(workspace: Workspace) -> Iterator[str]:
    for name in workspace.families:
        family = workspace.family(name)
        yield f"### {name}\n"
        yield f"{family.title}. Source: {family.source}\n"
        drawn = zip(COLOUR_NAMES, drawn_scenarios(family), strict=True)
        labels = "; ".join(f"{colour}: {scenario.label}" for colour, scenario in drawn)
        yield f"![{family.title}](families/{name}.svg)\n\n{labels}.\n"
        rows = [(parameter.name, parameter.describe_values()) for parameter in family.parameters]
        rows += [("with", f"`{constraint}`") for constraint in family.constraints]
        yield TextTable(heads=("parameter", "values"), rows=rows).as_markdown(escape=False)
        yield ""


def render_defences_page(workspace: Workspace) -> str:
    return _join_page(
        generated_page_head("Defences"),
        "A defence acts against a hazard: it senses, and it changes the controller's commands on their way "
        "to the plant.\nIts place in the library is `fault_library/defences/<name>.yaml`; its model is a "
        "small Python file,\n`templates/defences/<model>.py`. The target's manifest says where commands can "
        "be changed: [`actuation`](target-manifest.md#the-actuation).\n",
        f"The first key is `schema: {defence_yaml.SCHEMA}`. {_STRICT_YAML_LINKS}\n",
        *model_sections("defence.md", defence_yaml.DefenceModel),
        _DEFENCE_RULES,
    )


def render_manifests_page(workspace: Workspace) -> str:
    return _join_page(
        generated_page_head("Target manifests"),
        "A manifest at `fault_library/targets/<name>.yaml` holds everything that the harness knows "
        "about a controller.\nTo write one, see [Add a target](../how-to/add-a-target.md). "
        "[Channels](channels.md) lists "
        "what the manifests of this library\nrecord.\n",
        f"The first key is `schema: {manifest_files.SCHEMA}`. {_STRICT_YAML_LINKS}\n",
        *model_sections("target-manifest.md", manifest_files.ManifestModel),
        "## Scales of severity\n",
        "The files in `fault_library/severity/` map a delta-v to a class; see [Verdicts](../explanation/"
        "verdicts.md#severity).\nA manifest names one of them in `severity.scale`. The first key is `schema: "
        f"{severity_yaml.SCHEMA}`.\n",
        *model_sections("target-manifest.md", severity_yaml.SeverityScaleModel, parent_level=2),
    )


def render_hazard_analysis_page(workspace: Workspace) -> str:
    return _join_page(
        generated_page_head("Files of the hazard analysis"),
        "These are the files in `fault_library/stpa/`. [The hazard "
        "analysis](../explanation/hazard-analysis.md) explains them.\n[Change the hazard "
        "analysis](../how-to/change-the-hazard-analysis.md) shows how to write "
        "them. `mutator stpa` prints and checks them.\n",
        f"{_STRICT_YAML_LINKS} The first key of each file is `schema`: "
        f"`{accidents_and_hazards.HAZARDS_SCHEMA}`, `{context_tables.CONTEXT_TABLE_SCHEMA}`,\n"
        "`control_structure/1`, `unsafe_control_actions/1`, `causal_factors/1`.\n",
        *model_sections(
            "hazard-analysis.md",
            accidents_and_hazards.HazardsModel,
            context_tables.ContextTableModel,
            hazard_analysis_yaml.ControlStructureModel,
            hazard_analysis_yaml.UnsafeActionsModel,
            hazard_analysis_yaml.CausalFactorsModel,
        ),
    )


def render_clusters_page(workspace: Workspace) -> str:
    return _join_page(
        generated_page_head("Cluster files"),
        "A cluster file describes the cluster that `mutator run --cluster FILE.yaml` starts, and stops after "
        "the run. See\n[Run on many machines](../how-to/run-on-many-machines.md), with examples "
        "[for Slurm](../how-to/clusters/slurm.yaml) and\n"
        "[for Kubernetes](../how-to/clusters/kubernetes.yaml).\n",
        f"The first key is `schema: {cluster_files.CLUSTER_FILE_SCHEMA}`. {_STRICT_YAML_LINKS}\n",
        *model_sections("cluster-file.md", cluster_files.ClusterModel),
        "The run sets these options itself and rejects them in a file: "
        f"{', '.join(f'`{name}`' for name in cluster_files.RESERVED_OPTIONS)}.\n"
        "`security` must be `true` or left out. `processes` must equal `cores`, because each worker has one "
        "thread.\n",
    )


def _readings_section() -> Iterator[str]:
    yield "## Readings\n"
    yield (
        "The [readings](../explanation/concepts.md#readings) of a library are the keys under which its "
        "variants have injections.\n`fault_library/readings.yaml` declares them. Most libraries need none: "
        "`injections` is then a key of the variant itself.\nThe first reading is the default: every variant "
        "must have it, and it replaces readings that a variant does not have. The first key of the file is\n"
        f"`schema: {READINGS_SCHEMA}`.\n"
    )
    yield from model_sections("fault-spec.md", ReadingsModel, parent_level=2)


def _units_table() -> Iterator[str]:
    rows = [(f"`_{unit.suffix}`", unit.symbol, unit.dimension) for unit in units.UNITS.values()]
    yield TextTable(heads=("suffix", "unit", "quantity"), rows=rows).as_markdown(escape=False)
    yield ""
    yield (
        "The longest suffix applies: `by_per_m` is `by` in 1/m. Numbers are converted between units of the "
        "same quantity by a\nfactor. degC and K also differ by an offset, so they are two quantities: "
        "use the variable's unit.\n"
    )


def _join_page(*parts: str) -> str:
    return "\n".join(parts).rstrip() + "\n"
