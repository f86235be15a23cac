"""Messages about threads that prevent forking."""

from collections.abc import Sequence

_LISTED = 4  # the most names to list, because a pool can have dozens of threads
_NUMBERS = "OMP_NUM_THREADS, OPENBLAS_NUM_THREADS"
_KNOWN = (  # start of a thread's name, what the thread is, how to turn it off
    (
        "jemalloc_bg_thd",
        "of the memory allocator jemalloc",
        'set `MALLOC_CONF: "background_thread:false"` under `env` of the manifest (in pyarrow, which '
        "comes with pandas, the thread is already off)",
    ),
    ("ThreadPoolExecutor", "of a pool in Python", "do the pool's work in the step itself"),
)
_UNNAMED = (
    "of a library",
    f'set {_NUMBERS} and similar variables to "1" (the default) under `env` of the manifest, '
    "and turn off the library's thread pool (`cv2.setNumThreads(0)`, `torch.set_num_threads(1)`, "
    "`use_threads=False` of pyarrow)",
)
_OTHER = ("", "start the thread after the run, or not at all")


def too_many(others: Sequence[str]) -> str:
    told = [*dict.fromkeys(map(_told, others))]
    listed = ", ".join([*told[:_LISTED], *(["and more"] if len(told) > _LISTED else [])])
    return f"it has {len(others) + 1} threads, and only one can be forked: besides the main one, {listed}"


def turned_off(others: Sequence[str]) -> str:
    return "; ".join(dict.fromkeys(_about(name)[1] for name in others))


def _told(name: str) -> str:
    what = _about(name)[0]
    return (f"'{name}'" if name else "one without a name") + (f" ({what})" if what else "")


def _about(name: str) -> tuple[str, str]:
    if not name:
        return _UNNAMED
    return next(((what, remedy) for begin, what, remedy in _KNOWN if name.startswith(begin)), _OTHER)
