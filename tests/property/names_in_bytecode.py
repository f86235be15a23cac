"""The scope of each name in the bytecode of each function of a source."""

import dis
import types
from collections import Counter
from collections.abc import Iterator

from .injected_statements import Lines


def keeps_names(source: bytes, mutant: bytes) -> bool:
    """Whether every name in each function's bytecode has the same scope (local, free or global) in the
    mutant."""
    lines = Lines.of(mutant)
    try:
        after = dict(_homes(compile(mutant, "m.py", "exec", dont_inherit=True), lines))
    except SyntaxError:
        return False
    before = _homes(compile(source, "m.py", "exec", dont_inherit=True), Lines.of(source))
    return all(homes.items() <= after[key].items() for key, homes in before)


def is_carried_out(source: bytes, function: str, name: str) -> bool:
    """Whether the function's bytecode contains the name: unreachable code has no bytecode."""
    code = compile(source, "m.py", "exec", dont_inherit=True)
    found = _homes(code, Lines.of(source))
    return any(key[0].rpartition(".")[2] == function and name in homes for key, homes in found)


def _homes(code: types.CodeType, lines: Lines) -> Iterator[tuple[tuple[str, int, int], dict[str, str]]]:
    """Yield name, line and number of each function that is not injected, with its names."""
    stack, counts = [code], Counter[tuple[str, int]]()
    while stack:
        one = stack.pop()
        # not from `co_consts`, which can contain unreachable functions
        steps = dis.get_instructions(one)
        nested = [step.argval for step in steps if isinstance(step.argval, types.CodeType)]
        stack += [
            code for code in nested if code.co_name != "__annotate__"
        ]  # since Python 3.14; has no home line
        if one is not code and one.co_firstlineno in lines.injected:
            continue
        key = (one.co_qualname, lines.original[one.co_firstlineno] if one is not code else 0)
        counts[key] += 1
        yield (*key, counts[key]), _names_in(one)


def _names_in(code: types.CodeType) -> dict[str, str]:
    outside = ("LOAD_GLOBAL", "STORE_GLOBAL", "DELETE_GLOBAL", "LOAD_NAME")
    names = {step.argval: "global" for step in dis.get_instructions(code) if step.opname in outside}
    names |= dict.fromkeys((*code.co_varnames, *code.co_cellvars), "local")
    return names | dict.fromkeys(code.co_freevars, "free")
