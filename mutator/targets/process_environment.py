"""The environment of a target's processes: the variables that the harness or a manifest sets."""

import re
from collections.abc import Mapping

from mutator.config.yaml_source_lines import YamlSource

# Sums in another order differ in their last digits, so the libraries of linear algebra use one thread.
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
INHERITED_VARIABLES = ("PATH", "LD_LIBRARY_PATH", "HOME")  # the user's own values, needed to start Python
FIXED_VARIABLES = {
    "LC_ALL": "C.UTF-8",
    "PYTHONUTF8": "1",
    "PYTHONDONTWRITEBYTECODE": "1",
    **dict.fromkeys(THREAD_VARIABLES, "1"),
    # pyarrow, imported by pandas, starts a thread for its allocator, which prevents forking
    "JE_ARROW_MALLOC_CONF": "background_thread:false",
}
_REFUSED_PREFIXES = ("PYTHON", "LD_")  # prefixes of variables that change the interpreter or what it loads
_VARIABLES_SET_BY_HARNESS = ("TMPDIR", *INHERITED_VARIABLES, *FIXED_VARIABLES)
_NAME_PATTERN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")


def check_environment(env: Mapping[str, str], source: YamlSource) -> None:
    """Raise MutatorError for a variable in a manifest's `env` that cannot be set, or that the harness sets
    differently.
    """
    for name, value in env.items():
        if FIXED_VARIABLES.get(name) == value:
            continue
        if not _NAME_PATTERN.match(name):
            raise source.error(("env", name), f"'{name}'", expected="a name of letters, digits and _")
        if name in _VARIABLES_SET_BY_HARNESS or name.startswith(_REFUSED_PREFIXES):
            fixed = f" (it sets {name} to '{FIXED_VARIABLES[name]}')" if name in FIXED_VARIABLES else ""
            raise source.error(
                ("env", name),
                f"variable {name}",
                expected=f"a variable that the harness does not set{fixed}",
                remedy="leave it out",
            )
