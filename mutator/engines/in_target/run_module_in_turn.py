"""Run a module several times in one process: `python -P -s run_module_in_turn.py MODULE ARGUMENTS_JSON`.

Standard library only. The module is imported with its libraries once, and run as `__main__` with each list of
arguments. The first run that fails ends the process.
"""

import json
import runpy
import sys
from collections.abc import Iterable, Sequence


def run_in_turn(module: str, argument_lists: Iterable[Sequence[str]]) -> None:
    for arguments in argument_lists:
        sys.argv = [module, *arguments]
        try:
            runpy.run_module(module, run_name="__main__", alter_sys=True)
        except SystemExit as end:
            if end.code not in (None, 0):
                raise


if __name__ == "__main__":
    run_in_turn(sys.argv[1], json.loads(sys.argv[2]))
