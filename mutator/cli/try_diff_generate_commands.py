"""`try`, `diff` and `generate`: faults without a campaign."""

import re
from pathlib import Path
from typing import Annotated

import typer

import mutator
from mutator._common.confined_files import is_inside
from mutator._common.extension_doors import OPERATOR_DOOR
from mutator._common.message_text import counted
from mutator.cli import shell_completion
from mutator.cli.shared_options import (
    Json,
    Manifest,
    Reading,
    RunFolderOption,
    Seed,
    Value,
    Variant,
    Wide,
    WorkspaceOptions,
    with_workspace_options,
)
from mutator.cli.terminal_output import Terminal, short_path
from mutator.errors import EXIT_HARNESS_ERRORS, MutatorError
from mutator.mutants.patches_by_file import patch_without_new_files

_DEFAULT_OUT = Path("runs/try")
EXPERIMENT_ID_PATTERN = re.compile(r"[0-9a-f]{4,16}")  # an id, or enough of its start

SpecName = Annotated[
    str,
    typer.Argument(
        metavar="SPEC",
        help="Name of a spec in the library, or a spec file.",
        autocompletion=shell_completion.complete_specs,
    ),
]
TriggerText = Annotated[
    str,
    typer.Option(
        "--trigger",
        metavar="WHEN",
        help="A context (C1), a time in s (10), `always`, or a condition on observed values.",
        autocompletion=shell_completion.complete_triggers,
    ),
]


def register(app: typer.Typer) -> None:
    app.command("try", epilog=TRY_EXAMPLES)(try_spec)
    app.command("diff", epilog=DIFF_EXAMPLES)(diff)
    app.command("generate", epilog=GENERATE_EXAMPLES)(generate)


TRY_EXAMPLES = """\b
Examples:
  mutator try radar/chaff --scenario S1 --trigger C2
  mutator try radar/chaff -s S1 --value 40 --trigger 10   exactly 40 m, from 10 s
  mutator try my_fault.yaml --scenario S5 --plot          your own spec; plot both runs, too
"""


@with_workspace_options
def try_spec(
    spec: SpecName,
    scenario: Annotated[
        str,
        typer.Option(
            "--scenario",
            "-s",
            help="Name or file of a driving scenario.",
            autocompletion=shell_completion.complete_scenarios,
        ),
    ],
    trigger: TriggerText = "always",
    variant: Variant = None,
    value: Value = None,
    seed: Seed = None,
    reading: Reading = None,
    armed_after: Annotated[
        float | None,
        typer.Option(
            min=0,
            metavar="SECONDS",
            help="Arm contexts and `always` after this time. Default: the manifest's.",
        ),
    ] = None,
    plot: Annotated[
        bool, typer.Option("--plot", help="Plot the golden and the faulty run, next to their traces.")
    ] = False,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for patch, traces and plot.")
    ] = _DEFAULT_OUT,
    manifest: Manifest = None,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Inject one fault and run it once: diff and verdict."""
    from mutator.api.target_and_fault_selection import FaultChoice, SelectedTarget, middle_of_each_variant
    from mutator.cli.experiment_printing import print_trial

    terminal = Terminal(as_json, wide)
    if out == _DEFAULT_OUT and not is_inside(Path(), out):  # the current folder can be somebody's library
        raise MutatorError(
            "a link that leads out of the current folder",
            where=out,
            argument="out",
            remedy="name the folder at its end, or another one",
        )
    selected_target = SelectedTarget.of(workspace_options.workspace(), manifest)
    choice = FaultChoice(spec=spec, variant=variant, value=value, seed=seed, reading=reading)
    faults = selected_target.faults(choice)
    fault, _ = middle_of_each_variant(faults)[0]
    if len(faults) > 1:
        terminal.print_note(f"{fault.label}, one of {len(faults)} faults (choose with --variant or --value)")
    built_trigger = selected_target.trigger(trigger, armed_after)
    with terminal.show_spinner(f"running {scenario}, fault-free and faulty"):
        trial = mutator.try_fault(
            fault,
            scenario,
            built_trigger,
            seed=seed or 0,
            target=manifest,
            workspace=selected_target.workspace,
            out=out,
        )
    print_trial(terminal, trial, with_plot=plot)
    if trial.status is mutator.Status.HARNESS_ERROR:
        raise typer.Exit(EXIT_HARNESS_ERRORS)


DIFF_EXAMPLES = """\b
Examples:
  mutator diff radar/chaff                        of a spec
  mutator diff my_fault.yaml --trigger C2 --patch | (cd target && patch -p1)
  mutator diff 3f9a                               of an experiment in the newest run
"""


@with_workspace_options
def diff(
    spec_or_experiment: Annotated[
        str,
        typer.Argument(
            metavar="SPEC|EXPERIMENT",
            help="A spec, a spec file, or an experiment's id.",
            autocompletion=shell_completion.complete_specs_and_experiments,
        ),
    ],
    trigger: TriggerText = "always",
    variant: Variant = None,
    value: Value = None,
    seed: Seed = None,
    reading: Reading = None,
    run: RunFolderOption = None,
    patch: Annotated[
        bool,
        typer.Option(
            "--patch", help="Print the whole patch, including the probe; apply it with `patch -p1`."
        ),
    ] = False,
    manifest: Manifest = None,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Show what a fault changes in the source.

    For a spec, prints one diff for each variant: all values of a variant have the same diff.
    """
    terminal = Terminal(as_json)
    workspace = workspace_options.workspace()
    if EXPERIMENT_ID_PATTERN.fullmatch(spec_or_experiment) and not Path(spec_or_experiment).exists():
        from mutator.cli.experiment_printing import find_stored_experiment

        experiment = find_stored_experiment(workspace, run, spec_or_experiment)
        _print_diffs(terminal, [(experiment.fault.label, experiment.id, experiment.patch)], whole_patch=patch)
        return
    from mutator.api.mutants import build_selected
    from mutator.api.target_and_fault_selection import FaultChoice, SelectedTarget, middle_of_each_variant

    selected_target = SelectedTarget.of(workspace, manifest)
    choice = FaultChoice(spec=spec_or_experiment, variant=variant, value=value, seed=seed, reading=reading)
    built_trigger = selected_target.trigger(trigger)
    diffs = []
    for fault, fault_count in middle_of_each_variant(selected_target.faults(choice)):
        mutant = build_selected(selected_target, fault, built_trigger)
        count_note = f", one of {fault_count}" if fault_count > 1 else ""
        diffs.append((fault.label + count_note, mutant.id, mutant.patch))
    _print_diffs(terminal, diffs, whole_patch=patch)


def _print_diffs(terminal: Terminal, diffs: list[tuple[str, str, str]], *, whole_patch: bool) -> None:
    if terminal.as_json:
        terminal.print_json([{"fault": fault, "id": name, "patch": patch} for fault, name, patch in diffs])
    for fault, _, patch in diffs:
        # `patch` skips text before a diff, so piped output can include the heading.
        terminal.print_text(f"# {fault}", style="bold", without_folding=True)
        text, note = (patch, "") if whole_patch else patch_without_new_files(patch)
        terminal.print_diff(text)
        if note:
            terminal.print_note(note)


OPERATOR_NAMES = ", ".join(OPERATOR_DOOR.shipped_names())

GENERATE_EXAMPLES = """\b
Examples:
  mutator generate radar/chaff --out mutants                     patches for every context
  mutator generate 'radar/*' --out mutants --trees --trigger C2  also whole source trees
  mutator generate --campaign quickstart --out mutants           the mutants of a campaign
  mutator generate --operators arithmetic,constant --in 'pkg/**::Car.*' -s S1 --out mutants
                                                                 mutation operators, which need no spec
"""


@with_workspace_options
def generate(
    specs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SPEC",
            help="Specs, globs of specs, or spec files.",
            autocompletion=shell_completion.complete_specs,
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="A new or empty folder.")] = ...,  # type: ignore[assignment]
    campaign: Annotated[
        str | None, typer.Option(help="Use the mutants of this campaign instead of specs.")
    ] = None,
    trees: Annotated[bool, typer.Option("--trees", help="Also write each mutated source tree.")] = False,
    triggers: Annotated[
        list[str] | None,
        typer.Option(
            "--trigger",
            metavar="WHEN",
            help="As for `try`; repeatable. Default: every context.",
            autocompletion=shell_completion.complete_triggers,
        ),
    ] = None,
    operators: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help=f"Use mutation operators instead of specs: {OPERATOR_NAMES}; or all (without variable). "
            "Other packages can add operators.",
        ),
    ] = None,
    places: Annotated[
        list[str] | None,
        typer.Option(
            "--in",
            metavar="PLACE",
            help="With --operators: where, as PATH::FUNCTION or PATH, with `*` and `**`; repeatable.",
        ),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario",
            "-s",
            help="With --operators: only lines that this scenario's golden run executes.",
            autocompletion=shell_completion.complete_scenarios,
        ),
    ] = None,
    all_lines: Annotated[
        bool, typer.Option("--all-lines", help="With --operators: also lines that no run executes.")
    ] = False,
    sample: Annotated[
        int | None,
        typer.Option(
            min=1, help="With --operators: draw this many mutants, spread over operators and functions."
        ),
    ] = None,
    seed: Seed = None,
    reading: Reading = None,
    manifest: Manifest = None,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Write mutants as patches or source trees, with an index."""
    terminal = Terminal(as_json)
    workspace = workspace_options.workspace()
    choice = _parse_operator_choice(
        operators, places, scenario, all_lines, sample, seed, bool(specs or campaign)
    )
    if campaign and (specs or triggers):
        raise MutatorError(
            "--campaign together with specs or --trigger", expected="one or the other", where="generate"
        )
    if campaign:
        choices = mutator.Choices(seed=seed, reading=reading)
        mutants = mutator.MutantSet.of_campaign(campaign, choices=choices, workspace=workspace)
    elif choice:
        mutants = mutator.MutantSet.of_operators(choice, triggers or (), target=manifest, workspace=workspace)
        terminal.print_note(mutants.note)
    else:
        mutants = mutator.MutantSet.of_specs(
            specs or (),
            triggers or (),
            seed=seed,
            reading=reading,
            target=manifest,
            workspace=workspace,
        )
    with terminal.show_count(len(mutants), "mutants") as step:
        index = mutants.write(out, trees=trees, step=step)
    if as_json:
        terminal.print_json(index)
    terminal.print_text(f"{counted(len(index), 'mutant')} in {out}, listed in {out / 'index.csv'}")
    first_patch = out / index[0]["patch"]
    root = mutants.selected_target.manifest.root
    if mutants.selected_target.manifest.overlay is None:  # otherwise a patch spans two folders
        terminal.print_command("apply one:", f"patch -p1 -d {short_path(root)} < {first_patch}")


def _parse_operator_choice(
    operators: str | None,
    places: list[str] | None,
    scenario: str | None,
    all_lines: bool,
    sample: int | None,
    seed: int | None,
    has_other_source: bool,
) -> "mutator.OperatorChoice | None":
    """Collect the operator options, if any. `has_other_source`: specs or a campaign are given, too."""
    if operators is None:
        if places or scenario or all_lines or sample is not None:
            raise MutatorError(
                "--in, --scenario, --all-lines or --sample without --operators",
                where="generate",
                remedy=f"add --operators with any of {OPERATOR_NAMES}, or `all`",
            )
        return None
    if has_other_source or not places or (scenario is None) is not all_lines:
        raise MutatorError(
            "unsuitable options with --operators",
            where="generate",
            expected="no specs and no campaign, at least one --in, and either --scenario or --all-lines",
        )
    return mutator.OperatorChoice(
        operators=[name.strip() for name in operators.split(",")],
        places=places,
        scenario=scenario,
        sample=sample,
        seed=seed or 0,
    )
