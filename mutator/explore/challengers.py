"""Challengers: errors that change, as large as a constant one, which must be survived where it is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mutator._common.random_streams import random_generator
from mutator.errors import MutatorError
from mutator.model import Fault, Injection, Value

FORM_MARK = "~"  # between the name of a variant and that of its form
CHALLENGED_MODEL = "offset"  # the fault model whose error has a size with a sign
SIZE_PARAM = "by"  # of that model
_CHALLENGING_MODEL = "waveform"
_HALF_PERIODS_S = (0.05, 0.16, 0.5, 1.6, 5.0)
_GLITCH_PERIOD_S, _GLITCH_STEPS = 0.5, 2
_SEED_MARK = "seed_"
_MOST_SEED = 2**53  # every integer up to this is exact as a double


@dataclass(frozen=True, slots=True, kw_only=True)
class Challenger:
    """An error that changes: its shape, and its period in s, None for that of the fault or none."""

    shape: str
    period_s: float | None = None

    def differs_from_constant(self, duration_s: float, step_s: float) -> bool:
        """Whether a fault this long is not the constant one."""
        if self.shape == "alternating":
            assert self.period_s is not None
            return step_s <= self.period_s / 2 < duration_s - step_s / 2
        return self.shape == "noise" or duration_s > (_GLITCH_STEPS + 0.5) * step_s


_CHALLENGERS = {
    **{
        f"alternating_{half_s:g}s": Challenger(shape="alternating", period_s=2 * half_s)
        for half_s in _HALF_PERIODS_S
    },
    "ramp": Challenger(shape="ramp"),
    "noise": Challenger(shape="noise"),
    "glitch": Challenger(shape="pulses", period_s=_GLITCH_PERIOD_S),
}


def challenger_of(name: str) -> Challenger:
    """Return the challenger of this name; MutatorError if there is none."""
    base = name.partition(f"_{_SEED_MARK}")[0]
    if base not in _CHALLENGERS:
        raise MutatorError(
            f"challenger '{name}'", expected=f"one of {', '.join(_CHALLENGERS)}", remedy="correct the name"
        )
    return _CHALLENGERS[base]


def challenger_names(kinds: Sequence[str], seeds: int) -> list[str]:
    """Return the challengers of these kinds; noise once for each seed."""
    names = [name for name in _CHALLENGERS if name.partition("_")[0] in kinds]
    return [*names, *(f"noise_{seed_form(k)}" for k in range(1, seeds) if "noise" in kinds)]


def describe_challenger(name: str) -> str:
    """Return what a challenger does, as a clause: `alternating every 0.5 s`."""
    challenger = challenger_of(name)
    if challenger.shape == "alternating":
        assert challenger.period_s is not None
        return f"changing its sign every {challenger.period_s / 2:g} s"
    return {
        "ramp": "growing up to that size",
        "noise": "as noise up to that size",
        "pulses": f"as a glitch of {_GLITCH_STEPS} steps every {_GLITCH_PERIOD_S:g} s",
    }[challenger.shape]


def seed_form(number: int) -> str:
    """Return the form of a fault with another seed of its random numbers; that of the first is empty."""
    return f"{_SEED_MARK}{number}" if number else ""


def seed_number(form: str) -> int:
    """Return which seed a form has, from 0 on."""
    _, mark, number = form.rpartition(_SEED_MARK)
    return int(number) if mark else 0


def is_challenger(form: str) -> bool:
    return bool(form) and not form.startswith(_SEED_MARK)


def name_with_form(spec: str, form: str) -> str:
    """Return the name of a variant's form; the first is the variant itself."""
    return f"{spec}{FORM_MARK}{form}" if form else spec


def challenging_fault(fault: Fault, name: str, *, duration_s: float, step_s: float, seed: int) -> Fault:
    """Return the challenger of a fault with a constant error. It has the same size, with its sign first."""
    challenger, number = challenger_of(name), seed_number(name)
    injections = (
        _challenging_injection(
            injection,
            challenger,
            duration_s=duration_s,
            step_s=step_s,
            seed=int(random_generator(seed + number, f"{fault.spec}/{i}/challenger").random() * _MOST_SEED),
        )
        for i, injection in enumerate(fault.injections)
    )
    return replace(fault, spec=name_with_form(fault.spec, name), injections=tuple(injections))


def _challenging_injection(
    injection: Injection, challenger: Challenger, *, duration_s: float, step_s: float, seed: int
) -> Injection:
    if injection.model != CHALLENGED_MODEL:
        raise MutatorError(
            f"a challenger of the fault model {injection.model}",
            expected=f"faults of the model {CHALLENGED_MODEL}, whose error has a size with a sign",
        )
    shape = _shape_params(challenger, duration_s=duration_s, step_s=step_s)
    params: dict[str, Value] = {**dict(injection.params), **shape, "seed": seed}
    return replace(injection, model=_CHALLENGING_MODEL, params=tuple(sorted(params.items())))


def _shape_params(challenger: Challenger, *, duration_s: float, step_s: float) -> dict[str, Value]:
    params: dict[str, Value] = {"shape": challenger.shape}
    if challenger.shape == "ramp":
        params["period"] = duration_s
    elif challenger.period_s is not None:
        params["period"] = challenger.period_s
    if challenger.shape == "pulses":
        params["width"] = round(_GLITCH_STEPS * step_s, 9)
    return params
