"""How experiments are named and marked as tests."""

import os
import re
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.campaigns.plan import build_plan
from mutator.execution import listed_items
from mutator.execution.campaign_items import CampaignFile, ItemSource
from mutator.execution.item_running import ItemRunner
from mutator.execution.listed_items import ItemListing, list_experiments, list_plan
from mutator.execution.spec_places import SpecPlaces
from mutator.model import Experiment, Method
from mutator.workspace import Workspace
from tests.costs import is_soon

PLACE = ("radar.yaml", 7)


def names_of(*experiments: Experiment) -> list[str]:
    items = list_experiments(list(enumerate(experiments)), several_seeds=False, place_of=lambda fault: PLACE)
    return [item.name for item in items]


def test_a_name_says_fault_type_value_scenario_and_trigger(experiment: Callable[..., Experiment]) -> None:
    one = experiment(value=40.0)
    assert names_of(one) == [f"radar/chaff-40.0m-S1-C1-{one.id[:8]}"]


@pytest.mark.parametrize(
    ("trigger", "shown"),
    [("guided/C1", "C1"), ("at 3.5 s", "at3.5s"), ("d_rel <= 4 [m] :: é", "d_rel_4_m"), ("", None)],
)
def test_a_name_has_only_characters_that_a_node_id_can_have(
    experiment: Callable[..., Experiment], trigger: str, shown: str | None
) -> None:
    """pytest takes `::` and brackets apart, and terminals and CI systems expect ASCII."""
    [name] = names_of(experiment(value=1, trigger=trigger))
    assert re.fullmatch(r"[A-Za-z0-9.+_/-]+", name)
    assert name.split("-")[3:-1] == ([shown] if shown else [])


def test_ids_that_begin_alike_are_written_in_full(
    experiment: Callable[..., Experiment], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listed_items, "_ID_LENGTH", 0)
    experiments = [experiment(value=number) for number in range(3)]
    names = names_of(*experiments)
    assert [name.rpartition("-")[2] for name in names] == [one.id for one in experiments]
    assert names_of(experiments[0])[0].endswith("-")


def test_markers_are_module_fault_type_scenario_method_and_context(
    experiment: Callable[..., Experiment],
) -> None:
    """A random trigger has no context, and no marker has characters that `-m` does not know."""
    guided, drawn = experiment(), experiment(method=Method.RANDOM, trigger="random/C1")
    odd = replace(guided, scenario="a scenario")
    items = list_experiments(
        list(enumerate((guided, drawn, odd))), several_seeds=False, place_of=lambda fault: PLACE
    )
    assert [item.markers for item in items] == [
        ("radar", "chaff", "S1", "guided", "C1"),
        ("radar", "chaff", "S1", "random"),
        ("radar", "chaff", "guided", "C1"),
    ]


def test_every_experiment_of_a_plan_has_a_name_of_its_own_and_a_place(toycar: Workspace) -> None:
    """The place is the variant's line in its spec."""
    plan = build_plan(toycar, "toy")
    places = SpecPlaces(toycar, plan.campaign)
    items = list_experiments(list(enumerate(plan.experiments)), several_seeds=False, place_of=places.place_of)
    assert len({item.name for item in items}) == len(plan.experiments) == 24
    for item, one in zip(items, plan.experiments, strict=True):
        file, line = item.place
        assert line is not None
        text = (toycar.library / "faults" / f"{one.fault.module}/{one.fault.fault_type}.yaml").read_text()
        assert file.endswith(f"{one.fault.fault_type}.yaml")
        assert text.splitlines()[line - 1].strip().startswith(f"{one.fault.spec.rpartition('/')[2]}:")


def test_a_large_plan_is_listed_by_chunks(
    experiment: Callable[..., Experiment], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a shard, those that it has."""
    numbered = list(enumerate(experiment(value=i, scenario="A" if i < 4 else "B") for i in range(7)))

    def listed(pairs: list[tuple[int, Experiment]]) -> list[tuple[str, tuple[int, ...], str]]:
        items = list_plan(pairs, [2, 2, 3], several_seeds=False, place_of=lambda fault: PLACE)
        return [(item.name, item.positions, item.golden_key) for item in items]

    assert len(listed(numbered)) == 7
    monkeypatch.setattr(listed_items, "MOST_SINGLE_ITEMS", 2)
    assert listed(numbered) == [
        ("chunk-00000", (0, 1), "A"),
        ("chunk-00001", (2, 3), "A"),
        ("chunk-00002", (4, 5, 6), "B"),
    ]
    assert [positions for _, positions, _ in listed([*numbered[:2], *numbered[4:]])] == [(0, 1), (4, 5, 6)]


def test_collecting_5000_experiments_takes_at_most_two_seconds_of_a_quiet_machine(
    experiment: Callable[..., Experiment], tmp_path: Path
) -> None:
    """Of CPU time, with all that pytest does. Neither plan nor target nor library is opened."""
    (tmp_path / "many.yaml").write_text("")
    experiments = [experiment(value=number) for number in range(5000)]
    counted: list[int] = []

    class Many(ItemSource):
        @property
        def listing(self) -> ItemListing:
            numbered = list(enumerate(experiments))
            place = lambda fault: PLACE  # noqa: E731
            return ItemListing(items=list_experiments(numbered, several_seeds=False, place_of=place))

        def _begin(self) -> ItemRunner:
            raise AssertionError("collecting runs nothing")

    class Collecting:
        def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> CampaignFile:
            return CampaignFile.from_parent(parent, path=file_path, sources=[Many()])

        def pytest_collection_finish(self, session: pytest.Session) -> None:
            counted.append(len(session.items))

    alone = ["-c", os.devnull, "--rootdir", str(tmp_path), "--disable-plugin-autoload", "--noconftest"]
    began = time.process_time()
    pytest.main(
        [*alone, "-p", "no:cacheprovider", "--collect-only", "-qq", str(tmp_path / "many.yaml")],
        plugins=[Collecting()],
    )
    assert counted == [5000]
    assert is_soon(time.process_time() - began)
