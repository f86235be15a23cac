"""The message about threads that prevent forking."""

import re
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from mutator.engines import thread_messages
from mutator.engines.in_target.thread_names import other_thread_names


def test_the_names_of_all_other_threads_are_found() -> None:
    before = other_thread_names()
    done = threading.Event()
    started = [threading.Thread(target=done.wait, name=name) for name in ("poll", "radar")]
    for one in started:
        one.start()
    try:
        assert sorted([*before, "poll", "radar"]) == other_thread_names()
    finally:
        done.set()
        for one in started:
            one.join()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(int).result()
        assert any(name.startswith("ThreadPoolExecutor") for name in other_thread_names())


@pytest.mark.parametrize(
    ("names", "told", "remedy"),
    [
        (["jemalloc_bg_thd"], r"2 .* 'jemalloc_bg_thd' \(of the memory allocator jemalloc\)$", "MALLOC_CONF"),
        (["", ""], r"3 .* besides the main one, one without a name \(of a library\)$", "OMP_NUM_THREADS"),
        (["poll"], "2 .* besides the main one, 'poll'$", "start the thread after the run"),
        (
            ["ThreadPoolExecutor-0_0"],
            r"'ThreadPoolExecutor-0_0' \(of a pool in Python\)$",
            "in the step itself",
        ),
    ],
)
def test_the_message_names_threads_and_remedies(names: list[str], told: str, remedy: str) -> None:
    assert re.search(told, thread_messages.describe_too_many_threads(names))
    assert remedy in thread_messages.remedy_for_threads(names)
