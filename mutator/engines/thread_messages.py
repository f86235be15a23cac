"""Messages about threads that prevent forking."""

from collections.abc import Sequence

_MOST_LISTED_THREADS = 4  # the most names to list, because a pool can have dozens of threads
_THREAD_COUNT_VARIABLES = "OMP_NUM_THREADS, OPENBLAS_NUM_THREADS"
_KNOWN_THREADS = (  # start of a thread's name, what the thread is, how to turn it off
    (
        "jemalloc_bg_thd",
        "of the memory allocator jemalloc",
        'set `MALLOC_CONF: "background_thread:false"` under `env` of the manifest (in pyarrow, which '
        "comes with pandas, the thread is already off)",
    ),
    ("ThreadPoolExecutor", "of a pool in Python", "do the pool's work in the step itself"),
)
_UNNAMED_THREAD = (
    "of a library",
    f'set {_THREAD_COUNT_VARIABLES} and similar variables to "1" (the default) under `env` of the manifest, '
    "and turn off the library's thread pool (`cv2.setNumThreads(0)`, `torch.set_num_threads(1)`, "
    "`use_threads=False` of pyarrow)",
)
_OTHER_THREAD = ("", "start the thread after the run, or not at all")


def describe_too_many_threads(other_threads: Sequence[str]) -> str:
    descriptions = [*dict.fromkeys(map(_describe_thread, other_threads))]
    listed = ", ".join(
        [
            *descriptions[:_MOST_LISTED_THREADS],
            *(["and more"] if len(descriptions) > _MOST_LISTED_THREADS else []),
        ]
    )
    return (
        f"it has {len(other_threads) + 1} threads, and only one can be forked: besides the main one, {listed}"
    )


def remedy_for_threads(other_threads: Sequence[str]) -> str:
    return "; ".join(dict.fromkeys(_origin_and_remedy(name)[1] for name in other_threads))


def _describe_thread(name: str) -> str:
    what = _origin_and_remedy(name)[0]
    return (f"'{name}'" if name else "one without a name") + (f" ({what})" if what else "")


def _origin_and_remedy(name: str) -> tuple[str, str]:
    if not name:
        return _UNNAMED_THREAD
    return next(
        ((what, remedy) for begin, what, remedy in _KNOWN_THREADS if name.startswith(begin)), _OTHER_THREAD
    )
