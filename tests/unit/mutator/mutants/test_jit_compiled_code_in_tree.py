"""Functions that numba, JAX and other compilers take over are recognised in the source."""

import ast
from pathlib import Path

import pytest

from mutator.mutants import imported_names
from mutator.mutants.jit_compiled_code_in_tree import (
    jit_compiler_freezing_constant,
    jit_compiler_of_function,
    tracing_call_of_function,
)
from mutator.targets.source_tree import SourceTree, read_tree

BODY = "    return GAIN * y\n"


def tree_of(folder: Path, **texts: str) -> SourceTree:
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    return read_tree(folder, ["**"])


@pytest.mark.parametrize(
    ("text", "compiler"),
    [
        ("from numba import njit\n@njit\ndef law(y):\n", "numba.njit"),
        ("import numba as nb\n@nb.njit(fastmath=True)\ndef law(y):\n", "numba.njit"),
        ("from numba import njit as fast\n@fast(cache=True)\ndef law(y):\n", "numba.njit"),
        ("import numba\nfast = numba.njit(cache=True)\n@fast\ndef law(y):\n", "numba.njit"),
        (
            "from functools import partial\nimport jax\n@partial(jax.jit, static_argnums=0)\ndef law(y):\n",
            "jax.jit",
        ),
        ("import torch\n@torch.compile\ndef law(y):\n", "torch.compile"),
        ("from numba import *\n@njit\ndef law(y):\n", "numba.njit"),
        (
            "from math import *\nfrom numba import *\nfast = njit(cache=True)\n@fast\ndef law(y):\n",
            "numba.njit",
        ),
        ("import numba\nif numba:\n    fast = numba.njit\n@fast\ndef law(y):\n", "numba.njit"),
        ("import cython\n@cython.compile\ndef law(y):\n", "cython.compile"),
        (
            "import numba\n@numba.extending.register_jitable\ndef law(y):\n",
            "numba.extending.register_jitable",
        ),
    ],
)
def test_a_decorator_is_recognised_under_any_name(tmp_path: Path, text: str, compiler: str) -> None:
    """The decorator is found through aliases, options and `partial`."""
    tree = tree_of(tmp_path, m=text + BODY)
    assert jit_compiler_of_function(tree, "m.py", "law", {}) == compiler


@pytest.mark.parametrize(
    "after",
    [
        "law = njit(law)\n",
        "fast = njit(cache=True)(law)\n",
        "class C:\n    def __init__(self):\n        self.law = njit(law)\n",
        "fast = njit(py_func=law)\n",
        "import jax\nfast = njit(jax.vmap(jax.grad(law)))\n",
    ],
)
def test_a_function_that_is_given_to_a_compiler_is_compiled(tmp_path: Path, after: str) -> None:
    """A call of the compiler counts like its decorator, wherever it stands."""
    tree = tree_of(tmp_path, m=f"from numba import njit\ndef law(y):\n{BODY}\ndef free(y):\n{BODY}\n{after}")
    assert jit_compiler_of_function(tree, "m.py", "law", {}) == "numba.njit"
    assert jit_compiler_of_function(tree, "m.py", "free", {}) is None


def test_methods_and_inner_functions_belong_to_what_is_compiled(tmp_path: Path) -> None:
    """`jitclass` compiles every method, `jit` the functions inside a function, `torch.compile` a module."""
    text = "import jax, numba, torch\n"
    text += "@numba.experimental.jitclass\nclass A:\n    def f(self, y):\n        return y\n"
    text += "@jax.jit\ndef outer(y):\n    def inner(x):\n        return x\n    return inner(y)\n"
    text += "class Net:\n    def forward(self, y):\n        return y\nnet = torch.compile(Net())\n"
    tree = tree_of(tmp_path, m=text)
    assert jit_compiler_of_function(tree, "m.py", "A.f", {}) == "numba.experimental.jitclass"
    assert jit_compiler_of_function(tree, "m.py", "outer.inner", {}) == "jax.jit"
    assert jit_compiler_of_function(tree, "m.py", "Net.forward", {}) == "torch.compile"


def test_another_file_can_compile_a_function(tmp_path: Path) -> None:
    """`fast = njit(law)` after `from m import law` compiles m.py's function."""
    tree = tree_of(
        tmp_path, m=f"def law(y):\n{BODY}", use="from m import law\nimport numba\nf = numba.njit(law)\n"
    )
    assert jit_compiler_of_function(tree, "m.py", "law", {}) == "numba.njit"


def test_a_compiler_that_the_manifest_turns_off_compiles_nothing(tmp_path: Path) -> None:
    """With NUMBA_DISABLE_JIT, numba leaves functions to Python."""
    tree = tree_of(tmp_path, m="from numba import njit\n@njit\ndef law(y):\n" + BODY)
    assert jit_compiler_of_function(tree, "m.py", "law", {"NUMBA_DISABLE_JIT": "1"}) is None
    assert jit_compiler_of_function(tree, "m.py", "law", {"NUMBA_DISABLE_JIT": "0"}) == "numba.njit"


def test_names_of_the_target_are_no_compilers(tmp_path: Path) -> None:
    """A decorator of the target's own that is called njit compiles nothing."""
    text = "# not numba\nfrom tools import njit\n@njit\ndef law(y):\n" + BODY
    assert jit_compiler_of_function(tree_of(tmp_path, m=text), "m.py", "law", {}) is None


def test_a_constant_that_only_compiled_functions_read_is_frozen(tmp_path: Path) -> None:
    """numba keeps the value that a global has when it compiles; one that Python reads, too, is free."""
    text = "from numba import njit\nGAIN = 2\nFREE = 3\n@njit\ndef law(y):\n    return GAIN * FREE * y\n"
    tree = tree_of(tmp_path, m=text + "def f():\n    return FREE\n")
    assert jit_compiler_freezing_constant(tree, "m.py", "GAIN", {}) == "numba.njit"
    assert jit_compiler_freezing_constant(tree, "m.py", "FREE", {}) is None


@pytest.mark.parametrize("other", ["from m import GAIN\n", "from m import *\n", "import m\nprint(m.GAIN)\n"])
def test_a_constant_that_another_file_reads_is_not_frozen(tmp_path: Path, other: str) -> None:
    text = "from numba import njit\nGAIN = 2\n@njit\ndef law(y):\n" + BODY
    assert (
        jit_compiler_freezing_constant(tree_of(tmp_path, m=text, n="import m\n"), "m.py", "GAIN", {})
        == "numba.njit"
    )
    assert jit_compiler_freezing_constant(tree_of(tmp_path, m=text, n=other), "m.py", "GAIN", {}) is None


def test_a_function_that_builds_a_graph_is_noted(tmp_path: Path) -> None:
    """casadi runs the law once, inside the arguments of `casadi.Function` or as a function given to it."""
    text = "import casadi as ca\ndef law(y):\n    return y\ndef free(y):\n    return y\n"
    text += "class C:\n    def __init__(self, y):\n        self.f = ca.Function('law', [y], [law(y)])\n"
    tree = tree_of(tmp_path, m=text)
    assert tracing_call_of_function(tree, "m.py", "law") == "casadi.Function"
    assert tracing_call_of_function(tree, "m.py", "free") is None


GUARDED = (
    "try:\n    from numba import njit\nexcept ImportError:\n    njit = print\n@njit\ndef law(y):\n",
    "try:\n    import numba\n    fast = numba.njit\nexcept (OSError, ImportError):\n    fast = print\n"
    "@fast\ndef law(y):\n",
    "try:\n    from numba import njit\nexcept Exception:\n    from tools import njit\n@njit\ndef law(y):\n",
    "try:\n    from numba import *\nexcept:\n    njit = print\n@njit\ndef law(y):\n",
)


@pytest.mark.parametrize("is_installed", [True, False])
@pytest.mark.parametrize("text", GUARDED)
def test_a_package_that_the_file_can_do_without_counts_if_it_is_installed(
    tmp_path: Path, text: str, is_installed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without numba, the file's own `njit` leaves the function to Python."""
    monkeypatch.setattr(imported_names, "find_spec", lambda name: object() if is_installed else None)
    compiler = jit_compiler_of_function(tree_of(tmp_path, m=text + BODY), "m.py", "law", {})
    # a name that the file also defines is its own, so a star import is then no evidence
    expected = "numba.njit" if is_installed and "*" not in text else None
    assert compiler == expected


def test_a_name_of_the_file_is_not_from_a_star_import(tmp_path: Path) -> None:
    text = "from numba import *\ndef njit(law):\n    return law\n@njit\ndef law(y):\n" + BODY
    assert jit_compiler_of_function(tree_of(tmp_path, m=text), "m.py", "law", {}) is None


CALLER = "from numba import njit\n@njit\ndef law(y):\n    return inner(y)\n"
INNER = "def inner(y):\n    return deep(y) + BIAS\n"
DEEP = "BIAS = 1\ndef deep(y):\n    return y\n"


def test_what_only_compiled_functions_call_is_compiled(tmp_path: Path) -> None:
    """A function counts if nothing else reads its name, in this file or another; so do its constants."""
    tree = tree_of(tmp_path, m=CALLER + INNER + DEEP)
    assert jit_compiler_of_function(tree, "m.py", "inner", {}) == "numba.njit"
    assert jit_compiler_of_function(tree, "m.py", "deep", {}) == "numba.njit"
    assert jit_compiler_of_function(tree, "m.py", "deep", {"NUMBA_DISABLE_JIT": "1"}) is None
    assert jit_compiler_freezing_constant(tree, "m.py", "BIAS", {}) == "numba.njit"


@pytest.mark.parametrize(
    ("more", "other"),
    [("def f():\n    return inner(1)\n", ""), ("", "from m import inner\n"), ("", "import m\nm.inner(2)\n")],
)
def test_what_python_calls_too_is_not_compiled(tmp_path: Path, more: str, other: str) -> None:
    """Neither it, nor what it calls, nor the constants of both."""
    tree = tree_of(tmp_path, m=CALLER + INNER + DEEP + more, n=other)
    assert jit_compiler_of_function(tree, "m.py", "inner", {}) is None
    assert jit_compiler_of_function(tree, "m.py", "deep", {}) is None
    assert jit_compiler_freezing_constant(tree, "m.py", "BIAS", {}) is None
    assert jit_compiler_of_function(tree, "m.py", "law", {}) == "numba.njit"


@pytest.mark.parametrize("call", ["import m\n", "from m import inner\n"])
def test_a_function_of_another_file_that_only_compiled_functions_call_is_compiled(
    tmp_path: Path, call: str
) -> None:
    name = "inner" if "from" in call else "m.inner"
    use = f"import jax\n{call}@jax.jit\ndef law(y):\n    return {name}(y)\n"
    assert jit_compiler_of_function(tree_of(tmp_path, m=INNER, n=use), "m.py", "inner", {}) == "jax.jit"
    use += f"def slow(y):\n    return {name}(y)\n"
    assert jit_compiler_of_function(tree_of(tmp_path, m=INNER, n=use), "m.py", "inner", {}) is None


def test_methods_and_lambdas_are_followed(tmp_path: Path) -> None:
    """A compiled method calls `self.inner`; a compiler can be given a lambda."""
    text = "import jax\nclass A:\n    @jax.jit\n    def law(self, y):\n        return self.inner(y)\n"
    text += "    def inner(self, y):\n        return y\n"
    text += "def deep(y):\n    return y\nfast = jax.jit(lambda y: deep(y))\n"
    tree = tree_of(tmp_path, m=text)
    assert jit_compiler_of_function(tree, "m.py", "A.inner", {}) == "jax.jit"
    assert jit_compiler_of_function(tree, "m.py", "deep", {}) == "jax.jit"


@pytest.mark.parametrize(
    "line",
    [
        "import os, numba",
        "import os, \\\n  numba as numba",
        "import os; import numba",
        "if True: import numba",
        "import \\\n  numba",
        "\ufeffimport numba",
    ],
)
def test_an_import_is_recognised_however_its_line_is_written(tmp_path: Path, line: str) -> None:
    """The search that spares most files from being parsed misses no form of an import."""
    tree = tree_of(tmp_path, m=f"{line}\n@numba.njit\ndef law(y):\n{BODY}")
    assert jit_compiler_of_function(tree, "m.py", "law", {}) == "numba.njit"


def test_files_without_a_compiler_are_not_parsed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A word in a comment, or a module of the target with a compiler's name, costs no parsing."""
    tree = tree_of(tmp_path, m="from sim import warp  # not numba\ndef law(y):\n" + BODY, other="jax = 1\n")
    monkeypatch.setattr(ast, "parse", None)
    assert jit_compiler_of_function(tree, "m.py", "law", {}) is None
