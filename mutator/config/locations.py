"""A place in the target as YAML writes it: `{file: ..., function: ..., after_assign: gap}`."""

import keyword

from pydantic import Field

from mutator.config.yaml_files import Keys, Source, StrictModel
from mutator.model import Anchor, AnchorKind, FaultLocation

PROBE_NAME = "_fi"  # reserved: the module that every mutant has and no target does (mutants/probe.py)


class AtModel(StrictModel, title="A place"):
    """Exactly one anchor is given. It must be found exactly once in the function, in statement position; if
    there are several, the error lists them and `nth` chooses one. Names are as written in the source
    (`gap`, `self.angle`, `frames.extend`)."""

    file: str = Field(description="A file of the target, relative to its root.")
    function: str = Field(description="A qualified name: `measure`, `Sonar.measure`, `outer.<locals>.inner`.")
    after_assign: str | None = Field(None, description="After the statement that assigns to this name.")
    before_assign: str | None = Field(None, description="Before the statement that assigns to this name.")
    after_call: str | None = Field(None, description="After the statement that calls this name.")
    before_call: str | None = Field(
        None, description="Before the statement that calls this name; the statement a guard leaves out."
    )
    before_return: str | None = Field(
        None, description="Before the `return` of this name; empty for a bare `return`."
    )
    entry: bool | None = Field(None, description="`true`: at the start of the function.")
    nth: int | None = Field(None, ge=1, description="Which of several hits, counted from 1.")

    def location(self, source: Source, keys: Keys) -> FaultLocation:
        """The location; errors point into `source` at `keys`."""
        given = [kind for kind in AnchorKind if getattr(self, kind.value) not in (None, False)]
        if len(given) != 1:
            raise source.error(
                keys,
                f"{len(given)} anchors" + (f" ({', '.join(given)})" if given else ""),
                expected=f"exactly one of {', '.join(AnchorKind)}",
                remedy="name one statement, e.g. `after_assign: gap`",
            )
        kind = given[0]
        name = "" if kind is AnchorKind.ENTRY else getattr(self, kind.value)
        if not (dotted_name(name) or (not name and kind in (AnchorKind.ENTRY, AnchorKind.BEFORE_RETURN))):
            raise source.error((*keys, kind.value), f"'{name}'", expected="a dotted name as in the source")
        if not dotted_name(self.function.replace(".<locals>", "")):
            raise source.error(
                (*keys, "function"),
                f"'{self.function}'",
                expected="a qualified name such as Sensor.measure",
            )
        anchor = Anchor(kind=kind, name=name, nth=self.nth)
        return FaultLocation(path=self.file, function=self.function, anchor=anchor)


def dotted_name(text: str) -> bool:
    """Whether `text` is a chain of identifiers that are no keywords and not the probe's name."""
    parts = text.split(".")
    return all(p.isidentifier() and not keyword.iskeyword(p) for p in parts) and parts[0] != PROBE_NAME
