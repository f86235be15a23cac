"""The data passed from spec to verdict: immutable, comparable, identified by content.

Declare new fields with `hashing.added_field`, so that existing ids do not change.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import Any

from mutator._common.hashing import added_field, as_json_types, content_id, digest, non_default_added_fields

Value = int | float | str | bool | None

OPERATOR_FAULTS_MODULE = "operators"  # the `module` of faults that mutation operators make


class AnchorKind(StrEnum):
    """Where a snippet is inserted, or, for VALUE_ANCHORS and LOAD_TIME_ANCHORS, which value changes."""

    AFTER_ASSIGN = "after_assign"
    BEFORE_ASSIGN = "before_assign"
    AFTER_CALL = "after_call"
    BEFORE_CALL = "before_call"
    BEFORE_RETURN = "before_return"
    ENTRY = "entry"
    ASSIGNED_VALUE = "assigned_value"
    RETURN_VALUE = "return_value"
    CONDITION = "condition"
    ARGUMENT = "argument"
    RESULT = "result"
    VALUE = "value"
    CONSTANT = "constant"
    DEFAULT = "default"


VALUE_ANCHORS = frozenset(
    (
        AnchorKind.ASSIGNED_VALUE,
        AnchorKind.RETURN_VALUE,
        AnchorKind.CONDITION,
        AnchorKind.ARGUMENT,
        AnchorKind.RESULT,
        AnchorKind.VALUE,
    )
)
LOAD_TIME_ANCHORS = frozenset((AnchorKind.CONSTANT, AnchorKind.DEFAULT))  # values that the probe sets


class Hold(StrEnum):
    """How long a fault stays active once its trigger fires."""

    WHILE = "while"  # whenever the condition holds
    FOR = "for"  # for a fixed time after the condition first holds
    TO_END = "to_end"  # from when the condition first holds to the end of the run


class Method(StrEnum):
    """How the trigger was chosen."""

    GUIDED = "guided"
    RANDOM = "random"


class AfterHazard(StrEnum):
    """Whether a run continues after a terminal hazard."""

    GO_ON = "go_on"
    STOP = "stop"


class Status(StrEnum):
    """Whether the experiment itself worked; independent of its outcome."""

    OK = "ok"  #: the run ended normally
    CRASHED = "crashed"  #: the controller raised an error or died
    TIMEOUT = "timeout"  #: the run reached its limit of time, steps or disk
    INVALID_MUTANT = "invalid_mutant"  #: the mutant does not compile, or an injected line raised an error
    HARNESS_ERROR = "harness_error"  #: the harness failed; `mutator.run` retries the experiment
    LEFT_OUT = "left_out"  #: its golden run has a hazard, and the campaign does not include such scenarios


class Outcome(StrEnum):
    """What the fault did, for experiments that ran."""

    NOT_ACTIVATED = "not_activated"  #: no injected statement ran while the fault was active
    MASKED = "masked"  #: activated; no compared channel left its tolerance, no hazard
    SDC = "sdc"  #: a compared channel left its tolerance, no hazard
    HAZARD = "hazard"  #: a hazard followed
    #: the golden run has a hazard, and the fault was not active before it
    NOT_JUDGED = "not_judged"


class GoldenClass(StrEnum):
    """Whether the golden run of a scenario, with its changes, ends well."""

    HAZARD_FREE = "hazard_free"
    HAZARD_WITHOUT_FAULT = "hazard_without_fault"


class AgainstGolden(StrEnum):
    """How the hazards of a run compare with those of a golden run that has some; the first that applies."""

    NOT_BEFORE = "not_before"  #: the fault was not active before golden's first hazard
    ANOTHER = "another"  #: a hazard that the golden run has not
    EARLIER = "earlier"  #: a hazard of golden, more than one step earlier
    WORSE = "worse"  #: a hazard of a higher severity class than golden's worst
    MISSING = "missing"  #: a hazard of golden does not come
    LATER = "later"  #: a hazard of golden, more than one step later
    SAME = "same"  #: the hazards of golden at their times


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """A statement of a function, an expression in it, or a value that is fixed when a module loads.

    It is the `nth` match (from 1) of `kind` and `name`; without `nth` there must be exactly one match.
    `which` selects an argument of a call by position (from 1) or keyword. `name` depends on the kind:

    * assignments, calls, arguments, returns: the name as in the source: `gap`, `self.angle`, `pose['x']`
    * `value`, `condition`, `return_value`: the expression
    * `constant`: `LIMIT` or `Class.LIMIT`; `default`: the parameter; neither has an `nth`
    * empty for `entry`, and to match any return or condition
    """

    kind: AnchorKind
    name: str = ""
    nth: int | None = None
    which: str | None = added_field(None)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultLocation:
    """A place in the target: a file relative to the root, a qualified function name and an anchor.

    The function is empty for a constant of a module or class.
    """

    path: str
    function: str
    anchor: Anchor


@dataclass(frozen=True, slots=True, kw_only=True)
class Injection:
    """One fault model applied at one location. `params` are sorted (name, value) pairs.

    With `where`, it affects the location only when this condition holds. With `call`, it affects only the
    n-th such execution since the fault's activation; with `every`, every n-th.
    """

    location: FaultLocation
    model: str
    params: tuple[tuple[str, Value], ...] = ()
    where: str | None = added_field(None)
    call: int | None = added_field(None)
    every: int | None = added_field(None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """When a fault is active. A random time is the condition `t >= T` with hold `to_end`."""

    name: str  #: name of the trigger: the name of a context, `always`, or a time
    condition: str  #: expression over time `t` and the observed variables
    hold: Hold = Hold.WHILE  #: how long the fault stays active: `while`, `for` or `to_end`
    hold_s: float | None = None  #: duration in s of the hold `for`
    armed_after_s: float = 0.0  #: time in s from which the trigger can fire


def fault_label(spec: str, value: Value, unit: str) -> str:
    """Return a fault's label for tables and messages: `sensor/bias/distance 35 m`.

    `value` is None or '' for no value, `unit` is `-` or '' for no unit.
    """
    if value is None or value == "":
        return spec
    return f"{spec} {value}" if unit in ("", "-") else f"{spec} {value} {unit}"


# what ids contain for a reading without a name: published ids have it
_READING_IN_IDS = "as_described"


@dataclass(frozen=True)
class Fault:
    """A fault with a fixed value: what it injects, where, and the hazard that it aims at."""

    spec: str  #: name of the variant: `<module>/<fault_type>/<variant>`
    module: str  #: module of the controller, as the spec names it
    fault_type: str  #: type of the fault, as the spec names it
    reading: str  #: reading of the spec that it follows; empty in a library that declares no readings
    value: Value  #: the drawn value, in `unit`; None: the fault has no value
    unit: str  #: unit of `value`, as the spec states it
    aim: str  #: the hazard that it aims at; empty if the spec names none
    #: where the source changes, and how; numbers in the unit of the changed variable
    injections: tuple[Injection, ...]
    hold: Hold | None = None  #: how long it stays active; None: as long as its trigger specifies
    changes: tuple[str, ...] = ()  #: changes of the scenario that the fault needs, such as `alone`

    @cached_property
    def id(self) -> str:
        """Digest of its content."""
        return content_id(self if self.reading else replace(self, reading=_READING_IN_IDS))

    @property
    def label(self) -> str:
        """The label in tables and messages."""
        return fault_label(self.spec, self.value, self.unit)

    @property
    def size(self) -> float:
        """The absolute value, or 0 if it is not a number."""
        return float(abs(self.value)) if isinstance(self.value, int | float) else 0.0


@dataclass(frozen=True, kw_only=True)
class ConcreteScenario:
    """A family of scenarios with a value for each parameter."""

    family: str  #: name of the family
    values: Mapping[str, int | float | str]  #: the values by the parameters' keys, such as `ego_kph`
    label: str  #: the values as text: `ego 60 km/h, gap 20 m`
    text: str  #: the scenario in the target's format

    @cached_property
    def digest(self) -> str:
        """The digest of the text."""
        return digest(self.text.encode())

    @property
    def name(self) -> str:
        """The name: the family, and the first 12 digits of the digest."""
        return f"{self.family}-{self.digest[:12]}"

    @property
    def label_with_family(self) -> str:
        """The family and the values as text: `follow, ego 60 km/h, gap 20 m`."""
        return f"{self.family}, {self.label}"


@dataclass(frozen=True)
class Experiment:
    """One run: a fault, a scenario, a trigger and a seed."""

    fault: Fault  #: what is injected
    scenario: str  #: name of the scenario
    scenario_digest: str  #: digest of the scenario file
    method: Method  #: how the trigger was chosen: `guided` or `random`
    trigger: Trigger  #: when the fault is active
    seed: int  #: seed of the simulation
    setting: tuple[str, ...] = ()  #: changes of the scenario that the campaign makes for all its experiments
    #: whether the run continues after a terminal hazard: `go_on` or `stop`
    after_hazard: AfterHazard = added_field(AfterHazard.GO_ON)
    end_s: float | None = added_field(None)  #: with `stop`: when the run ends (s); None: with its scenario
    #: the scenario, if a family gave it; name and digest identify it
    concrete: ConcreteScenario | None = field(default=None, compare=False, repr=False)

    @cached_property
    def id(self) -> str:
        """Digest of its content."""
        # the fault's id, not its content: a plan then hashes each fault once instead of once per run
        trigger = self.trigger_as_json
        parts = (self.scenario, self.scenario_digest, self.method, trigger, self.seed, self.setting)
        later = non_default_added_fields(self)
        return content_id([self.fault.id, *parts, *([later] if later else [])])

    @cached_property
    def trigger_as_json(self) -> dict[str, Any]:
        """The trigger as JSON types."""
        return dict(as_json_types(self.trigger))

    @property
    def label(self) -> str:
        """The label in reports: `sensor/bias/distance 35 m, S1, guided C1`."""
        return f"{self.fault.label}, {self.drive_label}"

    @property
    def drive_label(self) -> str:
        """The label of the drive without its fault: `S1, guided C1`; `S1, at 2 s` if no method chose the
        trigger.
        """
        name = self.trigger.name.removeprefix(f"{self.method.value}/")
        return f"{self.scenario_label}, {f'{self.method_text} {name}'.lstrip()}"

    @property
    def scenario_label(self) -> str:
        """The label of the scenario: `S1`, or family and values, `follow, ego 60 km/h, gap 20 m`."""
        return self.concrete.label_with_family if self.concrete else self.scenario

    @property
    def family_or_scenario(self) -> str:
        """The family that gave the scenario, or the scenario of the library."""
        return self.concrete.family if self.concrete else self.scenario

    @property
    def method_text(self) -> str:
        """How the trigger was chosen; empty if it is neither a context nor a random time."""
        name = self.trigger.name
        listed_names = ("always", self.trigger.condition)
        is_listed = name.startswith(("at ", "always for ")) or name.partition(" for ")[0] in listed_names
        return "" if is_listed and self.method is Method.GUIDED else self.method.value

    @cached_property
    def changes(self) -> tuple[str, ...]:
        """All changes of the scenario: the fault's, then the setting's."""
        return tuple(dict.fromkeys((*self.fault.changes, *self.setting)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservedActivation:
    """When and how often injected statements ran while the fault was active. Times in s."""

    first: float
    last: float
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RunError:
    """An exception that ended a run.

    `place` is the innermost line of the target in the traceback, as `file:line` of the target's own file;
    empty if there is none.
    """

    kind: str
    message: str
    place: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DefenceActivity:
    """What a defence did in a run in which it acted. An activation is a row of such steps. Times in s."""

    name: str  #: name of the defence
    first: float  #: time of the first step in which it acted
    last: float  #: time of the last such step
    activations: int  #: number of activations
    steps: int  #: number of steps in which it acted
    conflicts: int  #: number of steps in which its range for a command and another defence's did not overlap
    #: (command, largest change of what the controller commanded, value furthest from 0 that it commanded)
    commands: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEnd:
    """The last step of a run: its time in s and the car's speed in m/s; None without a speed."""

    t: float
    speed: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """The stored result of one experiment. Times are simulation times in s; None: no such event."""

    experiment_id: str  #: id of the experiment
    status: Status  #: whether the experiment itself worked
    outcome: Outcome | None  #: what the fault did; None unless the status is `ok`
    #: why the status is not `ok`, why the fault was never active, or why it cannot be judged; else empty
    detail: str
    tree: str  #: digest of the source tree that ran
    activation: ObservedActivation | None  #: when and how often injected statements ran; None: never
    t_manifest: float | None  #: when a compared channel first left its tolerance, in s
    max_dev: tuple[tuple[str, float], ...]  #: largest deviation of each compared channel
    #: (name, first time in s) of each hazard after the activation, sorted by time; without `golden_hazards`
    hazards: tuple[tuple[str, float], ...]
    #: (name, first time in s) of each alert after the activation, sorted by time
    alerts: tuple[tuple[str, float], ...]
    trace_digest: str  #: digest of the trace
    #: the exception that ended the run: `kind`, `message`, `place`
    error: RunError | None = added_field(None)
    patch: str = ""  #: digest of the stored patch; empty without a mutant, and in old records
    t_end: float | None = added_field(None)  #: when a terminal hazard or a lost value ended the drive, in s
    dev: tuple[tuple[str, float], ...] = added_field(())  #: `max_dev` up to `t_end`; empty without `t_end`
    #: metrics of the manifest and margins of its hazards, if they have a value
    metrics: tuple[tuple[str, float], ...] = added_field(())
    #: (channel, first time in s, largest deviation) of each channel that left its tolerance in the drive
    left: tuple[tuple[str, float, float], ...] = added_field(())
    #: compared channel that first left its tolerance, and whether it was then `higher` or `lower` than
    #: golden, or `no_number` (NaN)
    first_change: tuple[str, str] | None = added_field(None)
    #: share of this channel's deviation, up to the first hazard, that had this direction
    first_change_share: float | None = added_field(None)
    #: speeds in m/s by their names in the results, from the activation to the first hazard
    speeds: tuple[tuple[str, float], ...] = added_field(())
    #: how the hazards compare with golden's; None if golden has none, or if the fault was never active
    against_golden: AgainstGolden | None = added_field(None)
    #: (name, first time in s) of each hazard in the drive that the golden run has, too, and that is no worse
    golden_hazards: tuple[tuple[str, float], ...] = added_field(())
    #: when a compared channel last differed from golden, in s, if that was at least 2 s before the end
    t_back: float | None = added_field(None)
    #: whether the controller was not `engaged` at the end, although it was in the golden run
    ended_disengaged: bool = added_field(False)
    #: what each defence that acted did, in the order in which they act; only if the run ended normally
    defences: tuple[DefenceActivity, ...] = added_field(())
    #: the last step of a run in a tree with defences
    run_end: RunEnd | None = added_field(None)
