"""Help of a subcommand: it names values, as `N` or `SPEC`, instead of showing the parser's types."""

import re
from typing import Any

from typer.core import TyperCommand

# of the value of an option that declares no name, by the parser's type
_NAME_BY_TYPE = {"int": "N", "int range": "N", "float": "X", "float range": "X", "path": "PATH"}
_LEAST_VALUE_PATTERN = re.compile(r"\bx>=(\S+?)(?=[];])")
_RANGE_PATTERN = re.compile(r"(?<=[\[ ])(\S+)<=x<=(\S+?)(?=[];])")


class NamedValuesCommand(TyperCommand):
    """A subcommand that shows names of values in its help."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        arguments = [param for param in self.get_params(ctx) if param.param_type_name == "argument"]
        return [self.options_metavar or "", *map(_usage_name, arguments)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        params = self.get_params(ctx)
        for kind, title in (("argument", "Arguments"), ("option", "Options")):
            records = [help_record(param, ctx) for param in params if param.param_type_name == kind]
            if rows := [record for record in records if record]:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the examples; a comment that does not fit beside its command stands below it."""
        formatter.write_paragraph()
        for line in (self.epilog or "").replace("\b\n", "").splitlines():
            command, gap, comment = line.partition("   ") if line.startswith("  ") else (line, "", "")
            if len(line) <= formatter.width:
                formatter.write(f"  {line}\n" if line else "\n")
            else:
                formatter.write(f"  {command}\n" + f"      {comment.strip()}\n" * bool(gap))


def help_record(param: Any, ctx: Any) -> tuple[str, str] | None:
    """Return the name of an argument or option with its value, and its text; None for a hidden one."""
    record = param.get_help_record(ctx)
    if record is None:
        return None
    name, text = record
    if param.param_type_name == "argument":
        name = param.display_name_raw
    elif param.metavar is None:
        name = re.sub(r"<(.*)>$", lambda match: _value_name(match[1]), name)
    return name, _LEAST_VALUE_PATTERN.sub(r"at least \1", _RANGE_PATTERN.sub(r"\1 to \2", text))


def _value_name(type_text: str) -> str:
    """Return the name of an option's value; the choices, if it has any."""
    return type_text if "|" in type_text else _NAME_BY_TYPE.get(type_text, "NAME")


def _usage_name(argument: Any) -> str:
    name = argument.display_name_raw
    if argument.nargs != 1 and not name.endswith("..."):
        name += "..."
    return name if argument.required else f"[{name}]"
