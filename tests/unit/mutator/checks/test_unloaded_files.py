"""What `check` says about a tree of which runs load little."""

from mutator.checks.unloaded_files import unloaded_files_findings
from mutator.targets.source_tree import matches_any_glob

TREE = [f"pkg/part{i}/m{j}.py" for i in range(30) for j in range(10)] + ["pkg/__init__.py", "law.py"]


def test_a_large_tree_of_which_runs_load_little_gets_narrower_files() -> None:
    """The globs match every loaded file, and leave others out."""
    loaded = ["law.py", "pkg/__init__.py", "pkg/part1/m1.py", "pkg/part2/m7.py"]
    [finding] = unloaded_files_findings(TREE, [*loaded, "elsewhere.py"])
    assert finding.found == "fault-free runs load 4 of 302 Python files, and each run copies all"
    globs = finding.remedy.partition("[")[2].partition("]")[0].split(", ")
    assert globs == ["pkg/*", "pkg/part1/**", "pkg/part2/**", "law.py"]
    assert all(matches_any_glob(path, globs) for path in loaded)
    assert not matches_any_glob("pkg/part3/m1.py", globs)


def test_a_small_tree_or_one_that_is_used_is_fine() -> None:
    """Copying it takes no noticeable time."""
    assert not list(unloaded_files_findings(TREE[:100], TREE[:2]))
    assert not list(unloaded_files_findings(TREE, TREE[:200]))
    assert not list(unloaded_files_findings(TREE, []))
