"""The records that pass from spec to verdict: frozen, comparable, identified by their content.

A field that joins one of them later is declared with `hashing.added`, so that it changes no id.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

from mutator._common.hashing import added, added_values, content_id, plain

Value = int | float | str | bool | None

OPERATORS = "operators"  # the module of faults that mutation operators make, without a spec


class AnchorKind(StrEnum):
    """Where, relative to a statement of the target, a snippet goes; of VALUE_ANCHORS, whose value changes."""

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
FIXED_ANCHORS = frozenset((AnchorKind.CONSTANT, AnchorKind.DEFAULT))  # values that the probe sets


class Hold(StrEnum):
    """How long a fault stays active once its trigger fired."""

    WHILE = "while"  # as long as the condition holds, again whenever it holds again
    FOR = "for"  # for a fixed time after the condition first held
    TO_END = "to_end"  # from the moment the condition first held to the end of the run


class Method(StrEnum):
    """How the trigger was chosen."""

    GUIDED = "guided"
    RANDOM = "random"


class AfterHazard(StrEnum):
    """What becomes of a run whose drive a terminal hazard has ended."""

    GO_ON = "go_on"
    STOP = "stop"


class Status(StrEnum):
    """Whether the experiment itself worked; never mixed with its outcome."""

    OK = "ok"  #: the run ended as it should
    CRASHED = "crashed"  #: the controller raised an error or died
    TIMEOUT = "timeout"  #: the run reached its limit of time, steps or disk
    INVALID_MUTANT = "invalid_mutant"  #: the mutant does not compile
    HARNESS_ERROR = "harness_error"  #: the harness failed; `mutator.run` tries it again


class Outcome(StrEnum):
    """What the fault did, for experiments that ran."""

    NOT_ACTIVATED = "not_activated"  #: no injected statement ran while triggered
    MASKED = "masked"  #: activated; no compared channel left its tolerance, no hazard
    SDC = "sdc"  #: a compared channel left its tolerance, no hazard
    HAZARD = "hazard"  #: a hazard followed


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """A statement of a function or an expression in it, or a value that is fixed when its module is loaded:
    the `nth` (from 1) that fits `kind` and `name`.

    `name` is what is assigned to, called or returned, as in the source (`gap`, `self.angle`, `pose['x']`);
    of a `value`, `condition` or `return_value` it is the expression. It is empty for `entry`, and where any
    return or condition will do. Of a `constant` it is `LIMIT` or `Class.LIMIT`, of a `default` the parameter;
    these have no `nth`. `which` chooses an argument of a call, by its place (from 1) or keyword.
    Without `nth` there must be exactly one hit.
    """

    kind: AnchorKind
    name: str = ""
    nth: int | None = None
    which: str | None = added(None)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultLocation:
    """A place in the target: a file relative to its root, a qualified function name, an anchor. The function
    is empty for a constant of a module or class."""

    path: str
    function: str
    anchor: Anchor


@dataclass(frozen=True, slots=True, kw_only=True)
class Injection:
    """One fault model applied at one location. `params` are sorted (name, value) pairs.

    It acts only `where` a condition over names known there holds; and then only in execution number `call`,
    or in every one whose number `every` divides, counted from when the fault became active.
    """

    location: FaultLocation
    model: str
    params: tuple[tuple[str, Value], ...] = ()
    where: str | None = added(None)
    call: int | None = added(None)
    every: int | None = added(None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """When a fault is active.

    `condition` is a validated expression over time `t` and what the target observes;
    it can fire from `armed_after_s` on. A random time is the condition `t >= T` with hold `to_end`.
    """

    name: str  #: name of the trigger: a context, `always`, a time
    condition: str  #: expression over time `t` and what the target observes
    hold: Hold = Hold.WHILE  #: how long the fault stays active: `while`, `for` or `to_end`
    hold_s: float | None = None  #: how long in s, for the hold `for`
    armed_after_s: float = 0.0  #: time in s from which the condition can fire


def fault_label(spec: str, value: Value, unit: str) -> str:
    """What tables and messages call a fault: `sensor/bias/distance 35 m`.

    `value` and `unit` are as the spec states them, or as they stand in a table: None or '' for no value, `-`
    or '' for no unit.
    """
    if value is None or value == "":
        return spec
    return f"{spec} {value}" if unit in ("", "-") else f"{spec} {value} {unit}"


@dataclass(frozen=True)
class Fault:
    """One fault with its value drawn: what is injected, where, and what it aims at.

    `value` and `unit` are as the spec states them (for tables); `injections` carry numbers in the unit of
    the variable they change.
    `hold` overrides the trigger's when the fault by its nature latches. `changes` are the changes
    of the scenario that belong to the fault (`alone`).
    """

    spec: str  #: name of the variant: `<module>/<fault_type>/<variant>`
    module: str  #: module of the controller, as the spec names it
    fault_type: str  #: type of the fault, as the spec names it
    reading: str  #: reading of the spec that it follows
    value: Value  #: the drawn value, in `unit`; None: the fault has no value
    unit: str  #: unit of `value`, as the spec states it
    aim: str  #: the hazard that it aims at
    #: where the source changes, and how; numbers in the unit of the changed variable
    injections: tuple[Injection, ...]
    hold: Hold | None = None  #: how long it stays active; None: as its trigger says
    changes: tuple[str, ...] = ()  #: changes of the scenario that belong to the fault (`alone`)

    @cached_property
    def id(self) -> str:
        """Digest of its content."""
        return content_id(self)

    @property
    def label(self) -> str:
        """What tables and messages call it."""
        return fault_label(self.spec, self.value, self.unit)

    @property
    def size(self) -> float:
        """How large its value is, whatever the sign; 0 for one that is no number."""
        return float(abs(self.value)) if isinstance(self.value, int | float) else 0.0


@dataclass(frozen=True)
class Experiment:
    """One run: a fault, in a scenario, under a trigger, with a seed.

    `setting` names the changes of the scenario that a campaign makes for all its experiments.
    """

    fault: Fault  #: what is injected
    scenario: str  #: name of the scenario
    scenario_digest: str  #: digest of the scenario file
    method: Method  #: how the trigger was chosen: `guided` or `random`
    trigger: Trigger  #: when the fault is active
    seed: int  #: seed of the simulation
    setting: tuple[str, ...] = ()  #: changes of the scenario that the campaign makes for all its experiments
    #: whether the run goes on after a terminal hazard: `go_on` or `stop`
    after_hazard: AfterHazard = added(AfterHazard.GO_ON)

    @cached_property
    def id(self) -> str:
        """Digest of its content."""
        # through the fault's id, not its whole content: a plan hashes each fault once, not once a run
        trigger = self.plain_trigger
        parts = (self.scenario, self.scenario_digest, self.method, trigger, self.seed, self.setting)
        later = added_values(self)
        return content_id([self.fault.id, *parts, *([later] if later else [])])

    @cached_property
    def plain_trigger(self) -> dict[str, Any]:
        """The trigger as JSON knows it: in its id, and in its line of the plan."""
        return dict(plain(self.trigger))

    @property
    def label(self) -> str:
        """What reports call it: `sensor/bias/distance 35 m, S1, guided C1`."""
        return f"{self.fault.label}, {self.drive_label}"

    @property
    def drive_label(self) -> str:
        """What reports call the drive that its fault is put to: `S1, guided C1`."""
        method = self.method.value
        return f"{self.scenario}, {method} {self.trigger.name.removeprefix(f'{method}/')}"

    @cached_property
    def changes(self) -> tuple[str, ...]:
        """All changes of the scenario, each once: the fault's own, then those of the setting."""
        return tuple(dict.fromkeys((*self.fault.changes, *self.setting)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What one run may use before it is stopped.

    Seconds of CPU and of wall time, MiB of address space, observed simulation steps, MiB that it writes.
    """

    cpu_s: int = 60
    wall_s: int = 300
    memory_mb: int = 4096
    steps: int = 20_000
    disk_mb: int = added(1024)


@dataclass(frozen=True, slots=True, kw_only=True)
class Activation:
    """How often an injected statement ran while triggered: simulation times in s, and a count."""

    first: float
    last: float
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RunError:
    """An exception that ended a run: its type, its text, and the innermost line of the target, `file:line` in
    the tree that ran (empty if it passed none)."""

    kind: str
    message: str
    place: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """All that is kept of one experiment. Times are seconds of simulation; None: did not happen.

    `error` is the exception that ended the run, if one did, whoever is to blame. `hazards` and `alerts` are
    (name, first time) pairs sorted by time; only what came at or after the activation is kept. `max_dev` and
    `t_manifest` refer to the manifest's compared channels. `t_end` is when a terminal hazard ended the drive,
    and `dev` what `max_dev` is up to there (empty without such an end: the same). `metrics` has the metrics
    of the manifest and the margins of its hazards, those that have a value. `left` has each channel that left
    golden beyond its tolerance before the end of the drive: its name, when first, and its largest deviation
    up to that end.
    """

    experiment_id: str  #: id of the experiment
    status: Status  #: whether the experiment itself worked
    outcome: Outcome | None  #: what the fault did; None unless the status is `ok`
    detail: str  #: why the status is not `ok`; empty if it is
    tree: str  #: digest of the source tree that ran
    activation: Activation | None  #: when and how often injected statements ran; None: never
    t_manifest: float | None  #: when a compared channel first left its tolerance, in s
    max_dev: tuple[tuple[str, float], ...]  #: largest deviation from golden of each compared channel
    #: (name, first time in s) of each hazard after the activation, sorted by time
    hazards: tuple[tuple[str, float], ...]
    #: (name, first time in s) of each alert after the activation, sorted by time
    alerts: tuple[tuple[str, float], ...]
    trace_digest: str  #: digest of the trace
    error: RunError | None = added(None)  #: the exception that ended the run: `kind`, `message`, `place`
    patch: str = ""  #: digest of the stored patch; empty without a mutant, and in old records
    t_end: float | None = added(None)  #: when a terminal hazard ended the drive, in s
    dev: tuple[tuple[str, float], ...] = added(())  #: `max_dev` up to `t_end`; empty without such an end
    #: metrics of the manifest and margins of its hazards, if they have a value
    metrics: tuple[tuple[str, float], ...] = added(())
    #: (channel, first time in s, largest deviation) of each channel that left golden before the end
    left: tuple[tuple[str, float, float], ...] = added(())
