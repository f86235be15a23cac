"""A place in the target as written in YAML: `{file: ..., function: ..., after_assign: gap}`."""

from pydantic import Field

from mutator.config.location_syntax import defence_module_name, is_assignable, is_dotted_name, is_expression
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.model import LOAD_TIME_ANCHORS, VALUE_ANCHORS, Anchor, AnchorKind, FaultLocation

# a function has one entry, and an empty name matches any return or condition
_ANCHOR_KINDS_WITHOUT_NAME = (
    AnchorKind.ENTRY,
    AnchorKind.BEFORE_RETURN,
    AnchorKind.RETURN_VALUE,
    AnchorKind.CONDITION,
)
# only these can name items, such as `pose['x']`
_ASSIGNMENT_ANCHOR_KINDS = (AnchorKind.AFTER_ASSIGN, AnchorKind.BEFORE_ASSIGN)


class LocationModel(StrictModel, title="A place"):
    """Give exactly one anchor. It must match exactly one place in the function. If it matches several, the
    error lists them, and `nth` chooses one. Anchors `before_...` and `after_...` match statements, not parts
    of expressions. Write names as in the source (`gap`, `self.angle`, `frames.extend`).
    """

    file: str | None = Field(None, description="A file of the target, relative to its root.")
    defence: str | None = Field(
        None,
        description="Instead of `file`: a [defence](defence.md), whose model the fault changes. In a tree "
        "without this defence, the injection does nothing.",
    )
    function: str | None = Field(
        None,
        description="A qualified name: `measure`, `Sonar.measure`, `outer.<locals>.inner`. Required by every "
        "anchor except `constant`.",
    )
    after_assign: str | None = Field(None, description="After the statement that assigns to this name.")
    before_assign: str | None = Field(None, description="Before the statement that assigns to this name.")
    after_call: str | None = Field(None, description="After the statement that calls this name.")
    before_call: str | None = Field(
        None,
        description="Before the statement that calls this name. A model of kind `guard` wraps the statement.",
    )
    before_return: str | None = Field(
        None, description="Before the `return` of this name; empty for a bare `return`."
    )
    entry: bool | None = Field(None, description="`true`: at the start of the function.")
    assigned_value: str | None = Field(
        None,
        description="The value assigned to this name, wherever the assignment is (`if a: b = 1`, `:=`).",
    )
    return_value: str | None = Field(
        None, description="The value of the `return` statement with this expression; empty for any `return`."
    )
    condition: str | None = Field(
        None,
        description="This condition of an `if`, `while`, `assert`, `x if ... else y` or comprehension; empty "
        "for any condition.",
    )
    argument: str | None = Field(
        None, description="An argument of the call of this name; `which` chooses one of several."
    )
    result: str | None = Field(None, description="The result of the call of this name, within an expression.")
    value: str | None = Field(
        None, description="The value of this expression; spaces and the kind of quotes do not matter."
    )
    constant: str | None = Field(
        None,
        description="A constant of the module (`LIMIT`) or of a class (`PIController.GAIN`), including the "
        "default of a dataclass field. The fault sets the constant while active, also in modules that "
        "imported its name, and restores it afterwards.",
    )
    default: str | None = Field(
        None,
        description="The default of this parameter; the fault sets it while active.",
    )
    which: str | int | None = Field(
        None, description="For `argument`: the argument's position in the call, from 1, or its keyword."
    )
    nth: int | None = Field(
        None,
        ge=1,
        description="Which of several matches, counted from 1. Lines that open a block (`if x:`) are counted "
        "after all other statements.",
    )

    def build_location(self, source: YamlSource, keys: KeyPath) -> FaultLocation:
        """Return the location; errors point at `keys` in `source`."""
        anchors = [kind for kind in AnchorKind if getattr(self, kind.value) not in (None, False)]
        if len(anchors) != 1:
            raise source.error(
                keys,
                f"{len(anchors)} anchors" + (f" ({', '.join(anchors)})" if anchors else ""),
                expected=f"exactly one of {', '.join(AnchorKind)}",
                remedy="name one statement, e.g. `after_assign: gap`",
            )
        kind = anchors[0]
        name = "" if kind is AnchorKind.ENTRY else getattr(self, kind.value)
        if not (_is_valid_anchor_name(kind, name) or (not name and kind in _ANCHOR_KINDS_WITHOUT_NAME)):
            expected = (
                "an expression as in the source" if kind in VALUE_ANCHORS else "a name as in the source"
            )
            raise source.error((*keys, kind.value), f"'{name}'", expected=expected)
        which = None if self.which is None else str(self.which)
        if which is not None and not (
            kind is AnchorKind.ARGUMENT and (which.isdecimal() or which.isidentifier())
        ):
            raise source.error(
                (*keys, "which"),
                f"'{which}'",
                expected="the position, from 1, or the keyword of an `argument`",
                remedy="correct it, or leave it out",
            )
        if kind in LOAD_TIME_ANCHORS and self.nth is not None:
            raise source.error(
                (*keys, "nth"),
                f"`nth` of a {kind.value}",
                expected="no `nth`, because each name has only one value",
                remedy="leave it out",
            )
        function = self._function_of(kind, source, keys)
        anchor = Anchor(kind=kind, name=name, nth=self.nth, which=which)
        return FaultLocation(path=self._path(source, keys), function=function, anchor=anchor)

    def _path(self, source: YamlSource, keys: KeyPath) -> str:
        if (self.file is None) == (self.defence is None):
            raise source.error(
                keys,
                "neither `file` nor `defence`" if self.file is None else "both `file` and `defence`",
                expected="one of them",
                remedy="name a file of the target, or the defence whose model the fault changes",
            )
        if self.defence is None:
            return self.file or ""
        if not self.defence.isidentifier():
            raise source.error((*keys, "defence"), f"'{self.defence}'", expected="the name of a defence")
        return f"{defence_module_name(self.defence)}.py"

    def _function_of(self, kind: AnchorKind, source: YamlSource, keys: KeyPath) -> str:
        name = self.function
        if kind is AnchorKind.CONSTANT:
            if name is not None:
                raise source.error(
                    (*keys, "function"),
                    f"'{name}' with a constant",
                    expected="no function: a constant belongs to a module or class",
                    remedy="leave it out; write a class's constant as `constant: PIController.GAIN`",
                )
            return ""
        if name is None:
            raise source.error(
                keys, "'function' is missing", expected="a qualified name such as Sensor.measure"
            )
        if not is_dotted_name(name.replace(".<locals>", "")):
            raise source.error(
                (*keys, "function"), f"'{name}'", expected="a qualified name such as Sensor.measure"
            )
        return name


def _is_valid_anchor_name(kind: AnchorKind, name: str) -> bool:
    if kind is AnchorKind.DEFAULT and "." in name:
        return False
    if kind in VALUE_ANCHORS:
        return is_expression(name)
    return is_dotted_name(name) or (kind in _ASSIGNMENT_ANCHOR_KINDS and is_assignable(name))
