"""Compile-time fault injection for driving controllers: from fault specs to verdicts."""

from typing import TYPE_CHECKING, Any

from mutator._common.version import VERSION

if TYPE_CHECKING:
    from mutator.api.runs import Run as Run
    from mutator.api.runs import load_run as load_run

__version__ = VERSION
_LAZY = ("Run", "load_run")  # pandas is not paid for by who only wants the version


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        from mutator.api import runs

        return getattr(runs, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
