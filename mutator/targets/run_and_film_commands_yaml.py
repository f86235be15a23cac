"""How a manifest runs and films a target."""

from collections.abc import Collection

from pydantic import Field

from mutator._common.message_text import describe_choices
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import YamlSource
from mutator.targets.command_placeholders import (
    FILM_PLACEHOLDERS,
    FILMED_RUN_PLACEHOLDERS,
    RUN_PLACEHOLDERS,
    check_placeholders,
)
from mutator.targets.manifest import FilmCommands


class ScenarioChangeModel(StrictModel, title="A change"):
    """Further arguments, and the scenarios that they make identical."""

    args: list[str] = Field(description="Further arguments.")
    same_in: list[str] = Field(
        min_length=2, description="The scenarios that the change makes identical. They share one run."
    )


class EntryModel(StrictModel, title="The entry"):
    """Arguments can contain placeholders: `{scenario}` is the scenario's file, `{seed}` the seed, `{out}` the
    folder for trace and record. `{cache}` is a folder that all runs of the target share. It can be missing,
    unwritable or damaged, and `mutator cache` deletes from it, so results must not depend on it. `{root}` is
    the target's root, to which a run must never write.
    """

    module: str = Field(description="The module, which is run as `python -m` from the root.")
    args: list[str] = Field(
        default_factory=lambda: ["--scenario", "{scenario}", "--seed", "{seed}", "--out", "{out}"],
        description="The module's arguments. Default: `--scenario {scenario} --seed {seed} --out {out}`.",
    )
    stepwise: str | None = Field(
        None,
        description="A function of the module (or `Class.method`) that takes these arguments and returns a "
        "steppable run, for [faster engines](../explanation/performance.md#which-engine-runs).",
    )
    independent: list[str] = Field(
        default_factory=list,
        description="Extra arguments for runs that must not use data left by other runs. These are the runs "
        "of the equivalence check and of mutants of files in `reads_itself`.",
    )
    changes: dict[str, list[str] | ScenarioChangeModel] = Field(
        default_factory=dict, description="Name of a scenario change -> its arguments."
    )


def check_commands(entry: EntryModel, film: FilmCommands | None, source: YamlSource) -> None:
    for key, command in (("entry", entry), ("film", film)):
        if command and not all(part.isidentifier() for part in command.module.split(".")):
            raise source.error(
                (key, "module"),
                f"'{command.module}'",
                expected="a dotted module name",
                remedy="write it as after `python -m`: package.module",
            )
    stepwise = entry.stepwise
    if stepwise is not None and not all(part.isidentifier() for part in stepwise.split(".")):
        raise source.error(
            ("entry", "stepwise"),
            f"'{stepwise}'",
            expected="a function of the entry module",
            remedy="write only its name, such as `open_run` or `Drive.open`",
        )
    _check_run_arguments(entry, source)
    if film is not None:
        _check_film_commands(film, entry.changes, source)


def _check_run_arguments(entry: EntryModel, source: YamlSource) -> None:
    keys = ("entry",)
    check_placeholders(entry.args, RUN_PLACEHOLDERS, source, (*keys, "args"))
    check_placeholders(entry.independent, RUN_PLACEHOLDERS, source, (*keys, "independent"))
    for name, change in entry.changes.items():
        change_keys = (*keys, "changes", name)
        if isinstance(change, list):
            check_placeholders(change, RUN_PLACEHOLDERS, source, change_keys)
        else:
            check_placeholders(change.args, RUN_PLACEHOLDERS, source, (*change_keys, "args"))


def _check_film_commands(film: FilmCommands, changes: Collection[str], source: YamlSource) -> None:
    for i, name in enumerate(film.pictures):
        if name not in changes:
            raise source.error(
                ("film", "pictures", i),
                f"'{name}'",
                expected=f"{describe_choices(changes)}, the entry's changes",
                remedy="correct the name",
            )
    check_placeholders(film.run_args, FILMED_RUN_PLACEHOLDERS, source, ("film", "run"))
    check_placeholders(film.run_for_still_args, ("t",), source, ("film", "run_for_still"))
    check_placeholders(film.args, FILM_PLACEHOLDERS, source, ("film", "args"))
    check_placeholders(film.still_args, FILM_PLACEHOLDERS, source, ("film", "still"))
