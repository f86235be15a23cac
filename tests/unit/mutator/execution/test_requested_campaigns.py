"""Which campaigns a pytest command asks for."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator.execution.requested_campaigns import RequestedCampaigns, find_requested_campaigns

CAMPAIGN = "# a comment\nschema: campaign/1\nname: x\n"
SOURCES = pytest.Config.ArgsSource


@pytest.fixture
def root(tmp_path: Path) -> Path:
    folder = tmp_path / "faults" / "campaigns"
    folder.mkdir(parents=True)
    for name in ("a", "b"):
        (folder / f"{name}.yaml").write_text(CAMPAIGN)
    (folder / "other.yaml").write_text("schema: fault/1\n")
    (tmp_path / "tests").mkdir()
    return tmp_path


def ask(
    root: Path, *args: str, source: Any = SOURCES.ARGS, campaign: str | None = None, folder: str = ""
) -> Any:
    """Return what a command with these arguments, in a folder of the project, asks for, and the places where
    pytest then looks."""
    config: Any = SimpleNamespace(
        args=list(args),
        args_source=source,
        rootpath=root,
        invocation_params=SimpleNamespace(dir=root / folder),
        getoption=lambda name: campaign,
    )
    return find_requested_campaigns(config), config.args


def settings(root: Path, *campaigns: str) -> None:
    (root / "pyproject.toml").write_text(
        f'[tool.mutator]\nlibrary = "faults"\ncampaigns = {list(campaigns)}\n'.replace("'", '"')
    )


def test_only_files_of_campaigns_are_asked_for(root: Path) -> None:
    """A library in the project is not collected unless somebody asks."""
    assert ask(root, str(root), source=SOURCES.INVOCATION_DIR)[0] == RequestedCampaigns()
    assert ask(root, "faults/campaigns/other.yaml")[0].is_empty
    assert ask(root, "faults/campaigns/none.yaml")[0].is_empty
    named = ask(root, "faults/campaigns/a.yaml::radar/x-1", "tests")[0]
    assert named.files == (root / "faults/campaigns/a.yaml",)


def test_the_campaigns_of_a_project_are_collected_where_pytest_looks(root: Path) -> None:
    """Plain pytest looks at them, even if its settings name another folder of tests."""
    settings(root, "faults/campaigns/[ab].yaml")
    both = (root / "faults/campaigns/a.yaml", root / "faults/campaigns/b.yaml")
    requested, places = ask(root, "tests", source=SOURCES.TESTPATHS)
    assert requested.files == both
    assert places == ["tests", *map(str, both)]
    assert requested.library == root / "faults"
    requested, places = ask(root, str(root), source=SOURCES.INVOCATION_DIR)
    assert (requested.files, places) == (both, [str(root)])
    assert ask(root, "faults")[0].files == both
    assert ask(root, "tests")[0].is_empty
    requested, places = ask(root, str(root / "tests"), source=SOURCES.INVOCATION_DIR, folder="tests")
    assert (requested.files, places) == ((), [str(root / "tests")])


def test_a_file_that_several_names_lead_to_is_one_campaign(root: Path) -> None:
    """Patterns that overlap and symbolic links name it; its own name counts."""
    campaigns = root / "faults" / "campaigns"
    (campaigns / "0.yaml").symlink_to("a.yaml")
    settings(root, "faults/campaigns/[0a].yaml", "faults/*/a.yaml")
    requested, places = ask(root, "tests", source=SOURCES.TESTPATHS)
    assert requested.files == (campaigns / "a.yaml",)
    assert places == ["tests", str(campaigns / "a.yaml")]
    assert ask(root, "faults/campaigns/0.yaml")[0].files == (campaigns / "0.yaml",)


@pytest.mark.parametrize(
    "head", ['schema: "campaign/1"', "'schema' : 'campaign/1'", "\ufeffschema: campaign/1"]
)
def test_a_campaign_is_one_in_whatever_way_its_head_is_written(root: Path, head: str) -> None:
    path = root / "faults" / "campaigns" / "a.yaml"
    path.write_text(f"{head}\nname: x\n", encoding="utf-8")
    assert ask(root, str(path))[0].files == (path,)
    path.write_text(f"about: {head}\n", encoding="utf-8")
    assert ask(root, str(path))[0].is_empty


def test_the_option_names_a_file_or_a_campaign_of_the_library(root: Path) -> None:
    assert ask(root, campaign="quickstart")[0].name == "quickstart"
    assert ask(root, campaign="my.yaml")[0].files == (Path("my.yaml"),)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[tool.mutator]\nlibraries = 'x'\n", "libraries"),
        ("[tool.mutator]\nlibrary = 3\n", "library = 3"),
        ("[tool.mutator]\ncampaigns = 'a.yaml'\n", "expected a list of files"),
        ("[tool.mutator]\ncampaigns = ['none.yaml']\n", "no file 'none.yaml'"),
        ("[tool.mutator]\ncampaigns = ['/none/*.yaml']\n", "relative to this file"),
        ("[tool.mutator]\ncampaigns = ['']\n", "no file ''"),
        ("[tool.mutator]\ncampaigns = ['faults']\n", "no file 'faults'"),
        ("[tool.mutator]\ncampaigns = [\n", "tool.mutator"),
    ],
)
def test_mistakes_in_the_settings_have_clear_errors(root: Path, text: str, problem: str) -> None:
    (root / "pyproject.toml").write_text(text)
    with pytest.raises(pytest.UsageError, match=r"pyproject\.toml") as error:
        ask(root, "tests")
    assert problem in str(error.value)
