"""Which worker of pytest-xdist gets which items."""

import os
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator.execution.piece_scheduling import PieceScheduling, is_scheduler_chosen


class Node:
    """A worker that notes what it gets."""

    def __init__(self, name: str) -> None:
        self.gateway = SimpleNamespace(id=name)
        self.items: list[int] = []
        self.shutting_down = False

    def send_runtest_some(self, indices: list[int]) -> None:
        assert not self.shutting_down
        self.items += indices

    def shutdown(self) -> None:
        self.shutting_down = True


def scheduling(names: str, *nodes: Node) -> PieceScheduling:
    """Return a schedule of items whose golden runs are the letters of `names`."""
    options: Any = SimpleNamespace(
        getvalue=lambda name: ["popen"] * len(nodes), getoption=lambda name: None, option=SimpleNamespace()
    )
    collection = [f"{name}{number}" for number, name in enumerate(names)]
    schedule = PieceScheduling(options, None, lambda node_id: node_id[0])
    for node in nodes:
        schedule.add_node(node)
    for node in nodes:
        schedule.add_node_collection(node, collection)
    assert schedule.collection_is_completed
    schedule.schedule()
    return schedule


def work_through(schedule: PieceScheduling, *nodes: Node) -> dict[str, list[int]]:
    """Let workers run what they get, as xdist does: none runs an item before it knows the next one."""
    done: dict[str, list[int]] = {node.gateway.id: [] for node in nodes}
    waiting = True
    while waiting:
        waiting = False
        for node in nodes:
            ran = done[node.gateway.id]
            if len(node.items) - len(ran) > (0 if node.shutting_down else 1):
                ran.append(node.items[len(ran)])
                schedule.mark_test_complete(node, ran[-1])
                waiting = True
    return done


@pytest.mark.parametrize("count", [1, 2, 3, 4, 9, 60])
def test_every_item_runs_once_and_every_worker_ends(count: int) -> None:
    nodes = Node("gw0"), Node("gw1")
    schedule = scheduling("A" * count, *nodes)
    done = work_through(schedule, *nodes)
    assert sorted(done["gw0"] + done["gw1"]) == list(range(count))
    assert schedule.tests_finished
    assert all(node.shutting_down for node in nodes)
    assert count < 2 or all(done.values())  # nobody idles while another one has two


def test_a_worker_keeps_its_golden_run_and_goes_on_forwards() -> None:
    """Two golden runs of equal length for two workers: each has one of them, in order."""
    nodes = Node("gw0"), Node("gw1")
    names = "A" * 24 + "B" * 24
    done = work_through(scheduling(names, *nodes), *nodes)
    for items in done.values():
        assert sum(names[a] != names[b] for a, b in pairwise(items)) <= 1
        assert all(a < b for a, b in pairwise(items) if names[a] == names[b])


def test_items_of_a_worker_that_died_run_elsewhere() -> None:
    """Its first item is the one that it ran: pytest reports this as failed."""
    first, second = Node("gw0"), Node("gw1")
    schedule = scheduling("A" * 12, first, second)
    lost = list(first.items)
    assert schedule.remove_node(first) == f"A{lost[0]}"
    done = work_through(schedule, second)
    assert sorted(done["gw1"]) == sorted({*range(12)} - {lost[0]})


@pytest.mark.parametrize(
    ("words", "is_chosen"),
    [
        ([], False),
        (["-n", "2"], False),
        (["-n", "2", "--dist", "load"], True),
        (["-n", "2", "--dist", "loadgroup"], True),
        (["-n", "2", "--dist", "loadfile"], False),
    ],
)
def test_a_scheduler_that_the_user_names_is_used(words: list[str], is_chosen: bool, tmp_path: Path) -> None:
    """Except for one that keeps the items of a file together: a campaign is one file."""
    answers = []

    class Asking:
        def pytest_configure(self, config: pytest.Config) -> None:
            answers.append(is_scheduler_chosen(config))

    alone = ["-c", os.devnull, "--rootdir", str(tmp_path), "--disable-plugin-autoload", "-p", "xdist"]
    pytest.main([*alone, "-p", "no:terminal", "--collect-only", *words, str(tmp_path)], plugins=[Asking()])
    assert answers == [is_chosen]


class Checks:
    """Checks of golden runs A and B, two runs each, which end when a test says so."""

    def __init__(self) -> None:
        self.waiting, self.begun, self.ended = 4, 0, 0

    @property
    def running(self) -> int:
        return self.begun - self.ended

    @property
    def has_waiting(self) -> bool:
        return self.begun < self.waiting

    def start_next(self) -> None:
        self.begun += 1

    def is_checked(self, golden_key: object) -> bool:
        return self.ended >= {"A": 2, "B": 4}[str(golden_key)]


def test_pieces_wait_for_the_checks_of_their_golden_run() -> None:
    """A check takes the place of a worker. As soon as something can run, one worker runs experiments."""
    nodes, checks = (Node("gw0"), Node("gw1")), Checks()
    options: Any = SimpleNamespace(
        getvalue=lambda name: ["popen"] * 2, getoption=lambda name: None, option=SimpleNamespace()
    )
    names = "A" * 12 + "B" * 12
    schedule = PieceScheduling(
        options,
        None,
        lambda node_id: node_id[0],
        lambda: checks if checks.has_waiting or checks.running else None,
        checks.is_checked,
    )
    for node in nodes:
        schedule.add_node(node)
    for node in nodes:
        schedule.add_node_collection(node, [f"{name}{number}" for number, name in enumerate(names)])
    schedule.schedule()
    assert (checks.running, nodes[0].items, nodes[1].items) == (2, [], [])
    checks.ended = 2
    schedule.deal()
    assert (checks.running, len(nodes[0].items) >= 2, nodes[1].items) == (1, True, [])
    assert {names[index] for index in nodes[0].items} == {"A"}
    checks.ended = 3
    schedule.deal()
    assert (checks.running, nodes[1].items) == (1, [])  # the last one
    checks.ended = 4
    schedule.deal()
    assert nodes[1].items
    done = work_through(schedule, *nodes)
    assert sorted(done["gw0"] + done["gw1"]) == list(range(24))
    assert all(node.shutting_down for node in nodes)


def test_one_worker_runs_what_is_checked_before_further_checks() -> None:
    node, checks = Node("gw0"), Checks()
    options: Any = SimpleNamespace(
        getvalue=lambda name: ["popen"], getoption=lambda name: None, option=SimpleNamespace()
    )
    schedule = PieceScheduling(options, None, lambda node_id: node_id[0], lambda: checks, checks.is_checked)
    schedule.add_node(node)
    schedule.add_node_collection(node, ["A0", "A1", "B2", "B3"])
    schedule.schedule()
    assert (checks.begun, node.items) == (1, [])
    checks.ended = 1
    schedule.deal()
    checks.ended = 2
    schedule.deal()
    assert (checks.begun, node.items) == (2, [0, 1])
