"""Names say what they hold: no empty words, and no two modules of one name."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
PARTICIPLES = (
    *("asked", "done", "found", "given", "gone", "heard", "held", "kept", "known", "left", "made", "meant"),
    *("own", "put", "said", "seen", "shown", "taken", "told", "wanted"),
)
PRONOUNS = ("it", "one", "ours", "says", "stuff", "theirs", "they", "thing", "things")
ADVICE = {
    **dict.fromkeys(PARTICIPLES, "says what happened to a value; what is the value: a path, matches, notes?"),
    **dict.fromkeys(PRONOUNS, "says only that there is a value; what would you call it in a debugger?"),
    "left": "is a direction, in modules that name the right; are these `remaining` ones?",
}
# what may keep such a name, with the reason
EXCEPTIONS: dict[str, str] = {
    "mutator/model.py::Record.left": "a key of stored records",
    **dict.fromkeys(
        (
            "mutator/checks/check_findings.py::Finding.found",
            "mutator/execution/session_summary.py::Summary.done",
            "mutator/glue.py::Run.done",
            "mutator/store/run_progress.py::Progress.done",
        ),
        "public, in Python and in JSON, where its meaning is plain",
    ),
    **dict.fromkeys(
        (
            "mutator/serve/job_event_reading.py::PhaseEvent.done",
            "mutator/serve/job_queue.py::JobState.DONE",
            "mutator/serve/served_reviews.py::SentDecisions.seen",
        ),
        "a key or a value that pages and server send each other",
    ),
    "target/selfdrive/sim/run.py::SteppedRun.done": "what a target that can be stepped offers to any harness",
    **dict.fromkeys(
        (
            "target/selfdrive/common/array_math.py::each.found",
            "target/selfdrive/common/compiled.py::stands_for.found",
            "target/selfdrive/controls/lib/fcw.py::FcwChecker._count._seen",
            "target/selfdrive/controls/lib/fcw.py::FcwChecker.reset._seen",
            "target/selfdrive/controls/lib/pathplanner.py::PathPlanner._update_width.seen",
            "target/selfdrive/controls/radard.py::Radard.update.one",
            "target/selfdrive/sim/effects/compiled_gaussian.py::ONE",
            "target/selfdrive/sim/effects/compiled_gaussian.py::agrees.one",
            "target/selfdrive/sim/effects/compiled_scattered.py::_droplets.kept",
            "target/selfdrive/sim/effects/compiled_scattered.py::agrees.seen",
            "target/selfdrive/sim/effects/effect.py::Effect._seen",
            "target/selfdrive/sim/moved_picture.py::AuthorsCodeShiftMover.seen",
            "target/selfdrive/sim/moved_picture.py::HomographyMover.seen",
            "target/selfdrive/sim/moved_picture.py::ShiftMover.seen",
            "target/selfdrive/sim/plant.py::Plant.shown",
            "target/selfdrive/sim/reference_plant.py::ReferencePlant.shown",
            "target/selfdrive/sim/simulator.py::Simulator.step.shown",
        ),
        "in code to which review decisions and ids of mutants are bound",
    ),
}
# module names that stand in several packages, with the reason
NAMESAKES: dict[str, str] = {
    "__main__": "Python's name of what `python -m` runs",
    "errors": "each of the two trees has exceptions of its own",
    **dict.fromkeys(("csv", "mcap", "parquet"), "one format, written (exports) and read (importers)"),
}
MOST_EXCEPTIONS = 60
MOST_NAMESAKES = 12
SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def bound(node: ast.AST) -> str | None:
    """The name that a node binds, if any."""
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            return node.name
        case ast.arg():
            return node.arg
        case ast.Name(ctx=ast.Store()):
            return node.id
        case ast.Attribute(ctx=ast.Store()):
            return node.attr
        case ast.alias():
            return node.asname
        case ast.ExceptHandler() | ast.MatchAs() | ast.MatchStar():
            return node.name
    return None


def bindings(node: ast.AST, scope: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str, int]]:
    """Yield scope, name and line of everything that is bound below a node."""
    for child in ast.iter_child_nodes(node):
        if name := bound(child):
            yield scope, name, getattr(child, "lineno", 0)
        yield from bindings(child, (*scope, child.name) if isinstance(child, SCOPES) else scope)


def empty_words(code: str, where: str) -> dict[str, int]:
    """Return the line of each empty word in a module, by `path::scope.name`."""
    names = list(bindings(ast.parse(code)))
    has_right = any("right" in name.lower() for _, name, _ in names)
    return {
        f"{where}::{'.'.join((*scope, name))}": line
        for scope, name, line in reversed(names)  # the first line counts
        if (word := name.strip("_").lower()) in ADVICE and not (word == "left" and has_right)
    }


def sources() -> list[Path]:
    return [path for tree in ("mutator", "target") for path in sorted((CLONE / tree).rglob("*.py"))]


def namesakes() -> dict[str, list[str]]:
    places: dict[str, list[str]] = {}
    for path in sources():
        places.setdefault(path.stem, []).append(str(path.relative_to(CLONE).parent))
    return {name: where for name, where in places.items() if len(where) > 1 and name != "__init__"}


def advice(place: str, line: int) -> str:
    path, _, name = place.partition("::")
    word = name.rpartition(".")[2]
    return f"{path}:{line}: `{word}` {ADVICE[word.strip('_').lower()]}"


def test_no_name_is_an_empty_word() -> None:
    words: dict[str, int] = {}
    for path in sources():
        words |= empty_words(path.read_text(encoding="utf-8"), str(path.relative_to(CLONE)))
    refused = [advice(place, line) for place, line in words.items() if place not in EXCEPTIONS]
    assert not refused, f"{len(refused)} names say nothing:\n" + "\n".join(refused)
    assert [place for place in EXCEPTIONS if place not in words] == [], "exceptions that nothing needs"
    assert len(EXCEPTIONS) <= MOST_EXCEPTIONS


def test_two_modules_have_one_name_only_for_a_reason() -> None:
    several = namesakes()
    unexplained = {name: where for name, where in several.items() if name not in NAMESAKES}
    assert not unexplained, f"say in the name what tells the modules apart: {unexplained}"
    assert [name for name in NAMESAKES if name not in several] == [], "reasons that nothing needs"
    assert len(NAMESAKES) <= MOST_NAMESAKES


@pytest.mark.parametrize(
    "code",
    [
        "found = 1",
        "def f(told): ...",
        "def _made(): ...",
        "class Known: ...",
        "self.left = 1",
        "import os as kept",
        "try: ...\nexcept E as it: ...",
        "match x:\n  case {'a': seen}: ...",
        "[x for own in y]",
        "left = 1\nwrong = 2",
        "for one in x: ...",
    ],
)
def test_empty_words_are_found_wherever_a_name_is_bound(code: str) -> None:
    assert empty_words(code, "x.py")


def test_a_direction_and_longer_names_are_not_empty() -> None:
    code = "def f(left, right): ...\nknown_names = found_in = given_name = 1\nx.told()\nprint(one)"
    assert empty_words(code, "x.py") == {}


def test_the_message_asks_what_the_value_is() -> None:
    assert advice("a/b.py::f.told", 3).startswith("a/b.py:3: `told` says what happened to a value; what is")
