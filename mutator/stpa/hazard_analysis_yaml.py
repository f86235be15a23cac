"""The hazard analysis as data: control structure, unsafe control actions, causal factors.

Loading checks all references between the files. `mutator.stpa.hazard_analysis_checks` compares the analysis
with the fault specs and the target.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase
from pathlib import Path

from pydantic import Field

from mutator._common.confined_files import path_below
from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.stpa.accidents_and_hazards import HazardList, load_hazard_list
from mutator.stpa.context_tables import ContextTable, load_context_table

_MOST_GRID_SIZE = 100  # most rows and columns of the drawing


class ComponentKind(StrEnum):
    HUMAN = "human"
    CONTROLLER = "controller"
    ESTIMATOR = "estimator"
    ACTUATOR = "actuator"
    SENSOR = "sensor"
    PROCESS = "process"


class UnsafeCategory(StrEnum):
    """The four ways in which a control action can be unsafe (Leveson, Engineering a Safer World, 2011)."""

    NOT_PROVIDED = "not_provided"
    PROVIDED = "provided"
    WRONG_TIMING = "wrong_timing"
    WRONG_DURATION = "wrong_duration"


class ProcessVariableModel(StrictModel, title="A variable"):
    """What a controller assumes about the process."""

    about: str = Field(description="What the variable means.")
    observed: str | None = Field(
        description="The observed variable that represents this one in triggers; `null` if there is none."
    )


class ComponentModel(StrictModel, title="A component"):
    """A component, drawn as a box."""

    kind: ComponentKind = Field(strict=False, description="The kind of component.")
    label: str = Field(description="The name in the drawing.")
    about: str = Field(description="What the component does.")
    modules: list[str] = Field(
        default_factory=list,
        description="The component's source files in the target. The path of a fault in one of them begins "
        "at this component.",
    )
    faults: list[str] = Field(
        default_factory=list,
        description="Faults of this component that are injected where others read its output: fault specs, "
        "or variants (`sensor/bias/distance`); `*` is a wildcard. Their path begins at this component and at "
        "others that name them, wherever they are injected.",
    )
    process_model: dict[str, ProcessVariableModel] = Field(
        default_factory=dict, description="Name -> variable in a controller's process model."
    )
    drawn: list[int] = Field(
        min_length=3,
        max_length=3,
        description="The place in the drawing: row from the top, column from the left, width in columns.",
    )

    def has_fault(self, variant: str) -> bool:
        """Return whether `faults` names a variant (`<module>/<fault_type>/<variant>`) or its spec."""
        names = (variant, variant.rpartition("/")[0])
        return any(fnmatchcase(name, pattern) for name in names for pattern in self.faults)


class LinkModel(StrictModel, title="A link"):
    """A link, drawn as an arrow."""

    from_: str = Field(alias="from", description="The component at which the link begins.")
    to: str = Field(description="The component at which the link ends.")
    label: str = Field(description="What the link carries.")
    studied: bool = Field(
        True, description="`false`: the link is drawn dashed and does not belong to fault paths."
    )


class ControlActionModel(StrictModel, title="A control action"):
    """An action by which a controller influences the process that it controls."""

    link: str = Field(description="The link that carries the action.")
    channel: str = Field(description="The recorded channel that shows the action.")
    about: str = Field(description="What the action does.")


class ControlStructureModel(StrictModel, title="control_structure.yaml"):
    """The controllers, their control actions, what these control, and the feedback they get."""

    about: str = Field(description="What the control structure shows.")
    components: dict[str, ComponentModel] = Field(description="Name -> component.")
    control_actions: dict[str, ControlActionModel] = Field(description="Name -> control action.")
    links: dict[str, LinkModel] = Field(description="Name -> link.")


class UnsafeActionModel(StrictModel, title="An unsafe control action"):
    """One way in which a control action causes a hazard."""

    action: str = Field(description="The control action.")
    category: UnsafeCategory = Field(
        strict=False, description="In which of the four ways the action is unsafe."
    )
    about: str = Field(description="What happens.")
    hazards: list[str] = Field(min_length=1, description="The hazards that it causes.")
    contexts: list[str] = Field(
        min_length=1, description="The contexts in which it causes them, as `table/row`."
    )


class UnsafeActionsModel(StrictModel, title="unsafe_control_actions.yaml"):
    """How each control action can be unsafe, and in which contexts."""

    about: str = Field(description="What the file lists.")
    tables: list[str] = Field(
        description="The context tables from which the unsafe control actions are taken."
    )
    unsafe_control_actions: dict[str, UnsafeActionModel] = Field(description="Id -> unsafe control action.")


class CausalFactorModel(StrictModel, title="A causal factor"):
    """A cause of unsafe control actions. Give either `faults` or `no_fault`."""

    about: str = Field(description="What goes wrong.")
    where: list[str] = Field(
        min_length=1, description="The links or components of the control structure where it goes wrong."
    )
    at: list[str] = Field(default_factory=list, description="The places in the target, as `file::function`.")
    leads_to: list[str] = Field(min_length=1, description="The unsafe control actions that it can cause.")
    faults: list[str] = Field(default_factory=list, description="The fault specs that represent it.")
    no_fault: str | None = Field(None, description="The reason why no fault spec represents it.")


class CausalFactorsModel(StrictModel, title="causal_factors.yaml"):
    """What can make a controller act unsafely, and the faults that represent it."""

    about: str = Field(description="What the file lists.")
    causal_factors: dict[str, CausalFactorModel] = Field(description="Id -> causal factor.")


@dataclass(frozen=True, kw_only=True)
class HazardAnalysis:
    """The whole analysis, in which all names are consistent; `*_source` refer to the files."""

    hazards: HazardList
    structure: ControlStructureModel
    structure_source: YamlSource
    context_tables: Mapping[str, ContextTable]
    unsafe_actions: Mapping[str, UnsafeActionModel]
    unsafe_actions_source: YamlSource
    factors_by_id: Mapping[str, CausalFactorModel]
    factors_source: YamlSource


def load_control_structure(path: Path) -> ControlStructureModel:
    """Read a control structure; MutatorError with file and line for a mistake."""
    structure, source = load_yaml_model(path, ControlStructureModel, "control_structure/1")
    _check_structure(structure, source)
    return structure


def load_hazard_analysis(folder: Path) -> HazardAnalysis:
    """Read hazards, control structure, unsafe control actions, context tables and causal factors from
    `folder`.

    MutatorError with file and line for the first unknown name, uncovered context or other mistake.
    """
    hazards = load_hazard_list(folder / "hazards.yaml")
    structure, s_source = load_yaml_model(
        folder / "control_structure.yaml", ControlStructureModel, "control_structure/1"
    )
    _check_structure(structure, s_source)
    unsafe, u_source = load_yaml_model(
        folder / "unsafe_control_actions.yaml", UnsafeActionsModel, "unsafe_control_actions/1"
    )
    tables = _load_context_tables(folder / "contexts", unsafe, u_source, structure)
    _check_unsafe(unsafe, u_source, structure, hazards, tables)
    factors, f_source = load_yaml_model(
        folder / "causal_factors.yaml", CausalFactorsModel, "causal_factors/1"
    )
    _check_factors(factors, f_source, structure, unsafe)
    return HazardAnalysis(
        hazards=hazards,
        structure=structure,
        structure_source=s_source,
        context_tables=tables,
        unsafe_actions=unsafe.unsafe_control_actions,
        unsafe_actions_source=u_source,
        factors_by_id=factors.causal_factors,
        factors_source=f_source,
    )


def _check_exists(source: YamlSource, keys: KeyPath, what: str, name: str, names: Collection[str]) -> None:
    if name not in names:
        raise source.error(
            keys,
            f"{what} '{name}'",
            expected=describe_choices(names),
            remedy="correct the name" + spelling_suggestion(name, list(names)),
        )


def _check_structure(structure: ControlStructureModel, source: YamlSource) -> None:
    _check_grid(structure, source)
    for name, link in structure.links.items():
        if name in structure.components:
            raise source.error(("links", name), f"link '{name}'", expected="a name that no component has")
        _check_exists(source, ("links", name, "from"), "component", link.from_, structure.components)
        _check_exists(source, ("links", name, "to"), "component", link.to, structure.components)
    for name, action in structure.control_actions.items():
        keys = ("control_actions", name, "link")
        _check_exists(source, keys, "link", action.link, structure.links)
        if structure.components[structure.links[action.link].from_].kind is not ComponentKind.CONTROLLER:
            raise source.error(keys, f"link '{action.link}'", expected="a link that comes from a controller")


def _check_grid(structure: ControlStructureModel, source: YamlSource) -> None:
    name_by_field: dict[tuple[int, int], str] = {}
    for name, component in structure.components.items():
        row, column, width = component.drawn
        fields = [(row, column + i) for i in range(min(width, _MOST_GRID_SIZE))]
        other = next((name_by_field[field] for field in fields if field in name_by_field), None)
        if other or not fields or min(row, column) < 0 or max(row, column, width) > _MOST_GRID_SIZE:
            raise source.error(
                ("components", name, "drawn"),
                f"'{name}' drawn at {component.drawn}" + (f", where '{other}' is" if other else ""),
                expected=f"row, column and width of at most {_MOST_GRID_SIZE}, a width of at least 1, no "
                "overlap",
            )
        name_by_field.update(dict.fromkeys(fields, name))


def _load_context_tables(
    folder: Path, unsafe: UnsafeActionsModel, source: YamlSource, structure: ControlStructureModel
) -> dict[str, ContextTable]:
    """Load the context tables of the unsafe actions. They can judge only the structure's control actions."""
    table_names = sorted(path.stem for path in folder.glob("*.yaml"))
    tables = {}
    for i, name in enumerate(unsafe.tables):
        _check_exists(source, ("tables", i), "context table", name, table_names)
        tables[name] = table = load_context_table(path_below(folder, f"{name}.yaml"))
        for row in table.rows:
            for action in row.hazards_by_action:
                keys = ("contexts", row.id, "actions", action)
                _check_exists(table.source, keys, "control action", action, structure.control_actions)
    return tables


def _check_unsafe(
    unsafe: UnsafeActionsModel,
    source: YamlSource,
    structure: ControlStructureModel,
    hazards: HazardList,
    tables: Mapping[str, ContextTable],
) -> None:
    rows = [f"{table.name}/{row.id}" for table in tables.values() for row in table.rows]
    for name, action in unsafe.unsafe_control_actions.items():
        keys: KeyPath = ("unsafe_control_actions", name)
        _check_exists(source, (*keys, "action"), "control action", action.action, structure.control_actions)
        for i, hazard in enumerate(action.hazards):
            _check_exists(source, (*keys, "hazards", i), "hazard", hazard, hazards.hazards)
        for i, context in enumerate(action.contexts):
            _check_exists(source, (*keys, "contexts", i), "context", context, rows)


def _check_factors(
    factors: CausalFactorsModel,
    source: YamlSource,
    structure: ControlStructureModel,
    unsafe: UnsafeActionsModel,
) -> None:
    places = (*structure.components, *structure.links)
    for name, factor in factors.causal_factors.items():
        keys: KeyPath = ("causal_factors", name)
        for i, place in enumerate(factor.where):
            _check_exists(source, (*keys, "where", i), "link or component", place, places)
        for i, action in enumerate(factor.leads_to):
            unsafe_actions = unsafe.unsafe_control_actions
            _check_exists(source, (*keys, "leads_to", i), "unsafe control action", action, unsafe_actions)
        if bool(factor.faults) == (factor.no_fault is not None):
            got = "both faults and no_fault" if factor.faults else "neither faults nor no_fault"
            raise source.error(
                keys, f"{got} in '{name}'", expected="fault specs, or the reason why there are none"
            )
