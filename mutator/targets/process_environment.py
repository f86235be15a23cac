"""The environment of a target's processes: the variables that the harness or a manifest sets."""

import re
from collections.abc import Mapping

from mutator.config.yaml_sources import YamlSource

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
KEPT = ("PATH", "LD_LIBRARY_PATH", "HOME")  # the user's own values, needed to start Python
FIXED = {
    "LC_ALL": "C.UTF-8",
    "PYTHONUTF8": "1",
    "PYTHONDONTWRITEBYTECODE": "1",
    **dict.fromkeys(THREADS, "1"),
    # pyarrow, imported by pandas, starts a thread for its allocator, which prevents forking
    "JE_ARROW_MALLOC_CONF": "background_thread:false",
}
_PREFIXES = ("PYTHON", "LD_")  # prefixes of variables that change the interpreter or what it loads
_OWN = ("TMPDIR", *KEPT, *FIXED)
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")


def check_environment(env: Mapping[str, str], source: YamlSource) -> None:
    """Raise MutatorError for a variable in a manifest's `env` that cannot be set, or that the harness sets
    differently.
    """
    for name, value in env.items():
        if FIXED.get(name) == value:
            continue
        if not _NAME.match(name):
            raise source.error(("env", name), f"'{name}'", expected="a name of letters, digits and _")
        if name in _OWN or name.startswith(_PREFIXES):
            fixed = f" (it sets {name} to '{FIXED[name]}')" if name in FIXED else ""
            raise source.error(
                ("env", name),
                f"variable {name}",
                expected=f"a variable that the harness does not set{fixed}",
                remedy="leave it out",
            )
