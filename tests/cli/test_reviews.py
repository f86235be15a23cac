"""The `review` command, and `run --require-reviewed`."""

import base64
import gzip
import json
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from mutator.cli import review_walk
from mutator.cli.app import main
from mutator.review.mutant_groups import groups_of_library
from mutator.workspace import Workspace

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json
JANE = ("--by", "Jane Doe")


def ids(cli: Cli, *words: object) -> list[str]:
    return [group["group"] for group in cli("review", *words, "--json").json]


@pytest.fixture(scope="session")
def known(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> dict[str, str]:
    toy = copy_toycar(tmp_path_factory.mktemp("known"))
    groups = groups_of_library(toy, toy.manifest("toycar"), specs=["sensor/*"])
    return {group.id: group.label for group in groups}


def about(known: dict[str, str], words: str) -> str:
    return next(name for name, what in known.items() if words in what)


def test_groups_without_approval_are_listed_first(cli: Cli, root: Path, known: dict[str, str]) -> None:
    first, *rest = known
    cli("review", "approve", first, *JANE)
    lines = cli("review").out.splitlines()
    assert [line.split()[0] for line in lines[1:-1]] == [*rest, first]
    assert lines[0].split() == ["group", "state", "what", "when", "faults", "runs"]
    assert lines[-1] == "5 groups: 4 new, 1 approved"
    (root / "templates/offset.py.j2").write_text("{{ target }} = {{ target }} {{ by | signed }}\n")
    states = [group["state"] for group in cli("review", "list", "--json").json]
    assert states == ["new"] * 4 + ["changed"]


def test_groups_are_found_by_filter_or_id_prefix(cli: Cli, root: Path, known: dict[str, str]) -> None:
    silent = about(known, "omission()")
    only = 'model == "omission" and match(trigger, "*time*") and not flagged'
    assert ids(cli, "--only", only, "--exclude", "faults > 7") == [silent]
    assert cli("review", "show", silent[:8], "--json").json[0]["group"] == silent
    for word, said in (("zz", "no group 'zz'"), ("", "several ids (5) start with ''")):
        answer = cli("review", "show", word)
        assert (answer.code, said in answer.err) == (2, True)
    assert "unknown column `color`" in cli("review", "--only", "color == 1").err


def test_a_group_is_shown_with_holes_and_values(cli: Cli, root: Path, known: dict[str, str]) -> None:
    longer = about(known, "offset(by, target=gap)")
    answer = cli("review", "show", longer)
    assert f"group {longer}: new" in answer.out
    assert "+            gap = gap ⟨by⟩  # fi:⟨id⟩" in answer.out
    assert re.search(r"^sensor/distance/longer \d m +as_described +\+ \d$", answer.out, re.MULTILINE)
    assert re.search(r"^  hwt .*\(near\)$", answer.out, re.MULTILINE)
    assert "\nvalues: by: 1 to 65 m\n" in answer.out
    assert re.search(r"^fault +reading +by \(m\)$", answer.out, re.MULTILINE)
    title = r"sensor/distance/longer \d+ to \d+ m: The other car seems further away\."
    assert re.search(rf"^{title}$", answer.out, re.MULTILINE)
    assert re.search(rf" new +{title} sensing\.py ", cli("review").out)
    [group] = cli("review", "show", longer, "--json").json
    assert group["values"][0]["by"].startswith("+ ")
    assert (group["units"]["by"], re.fullmatch(title, group["about"][0]) is not None) == ("m", True)
    assert len(group["values"]) == group["faults"] == 8  # four faults in each of two readings


def test_a_review_covers_the_library_specs_or_a_campaign(cli: Cli, root: Path, known: dict[str, str]) -> None:
    assert set(ids(cli, "--spec", "sensor/lane")) < known.keys()
    campaign = cli("review", "--campaign", "small", "--json").json
    assert {group["group"] for group in campaign} <= known.keys()
    assert all(group["runs"] for group in campaign)
    assert "--campaign together with --spec" in cli("review", "--campaign", "small", "--spec", "a").err


def test_decisions_are_stored(cli: Cli, root: Path, known: dict[str, str]) -> None:
    group = about(known, "omission()")
    answer = cli("review", "reject", group[:6], *JANE, "--remark", "too much", "--reason", "never  left out")
    decided = rf"{group} rejected by Jane Doe on 20..-..-.. \(never left out\)"
    assert re.fullmatch(decided, answer.out.splitlines()[0])
    assert re.search(rf"^{decided}$", cli("review").out, re.MULTILINE)
    assert [one["reason"] for one in cli("review", "--only", "reason", "--json").json] == ["never left out"]
    file = root / "fault_library/reviews/toycar.yaml"
    assert answer.out.splitlines()[1].endswith("4 new, 1 rejected")
    assert f'group: "{group}"' in file.read_text()
    tree = root / "tree/toycar/sensing.py"
    tree.write_text(tree.read_text().replace("offset = world.offset", "offset = 1.0 * world.offset"))
    [data] = cli("review", "show", group, "--json").json
    assert (data["state"], data["changed"]) == ("changed", ["target function", "diff"])
    assert [(one["by"], one["text"]) for one in data["remarks"]] == [("Jane Doe", "too much")]
    shown = cli("review", "show", group).out
    assert re.search(
        r"rejected by Jane Doe on \S+ \(never left out\) \(changed since: target function, diff\)", shown
    )
    assert cli("review", "approve", group, *JANE, "--json").json[0]["state"] == "approved"


def test_a_decision_needs_a_reviewer(
    cli: Cli, root: Path, known: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(root))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    group = next(iter(known))
    for words in ((), ("--by", " ")):
        answer = cli("review", "approve", group, *words)
        assert (answer.code, "expected: the reviewer's name" in answer.err) == (2, True)
        assert "add --by, or set git's user name: `git config --global user.name NAME`" in answer.err
    assert not (root / "fault_library/reviews").exists()
    (root / ".gitconfig").write_text("[user]\nname = Git Smith\n")
    assert " approved by Git Smith on " in cli("review", "approve", group).out


def test_a_decision_about_filtered_groups_needs_confirmation(
    cli: Cli, root: Path, known: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("review", "approve", "--only", 'state == "new" and model == "offset"', *JANE)
    asked = cli(*words)
    assert (asked.code, "confirmation of 3 groups (3 new)" in asked.err) == (2, True)
    assert "add --yes to approve without confirmation" in asked.err
    questions: list[str] = []
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr(typer, "confirm", lambda text: bool(questions.append(text)))
    assert (cli(*words).code, questions) == (0, ["approve 3 groups (3 new)?"])
    assert not (root / "fault_library/reviews").exists()
    assert cli(*words, "--yes").out.splitlines()[-1].endswith(": 2 new, 3 approved")
    assert "no group matches" in cli(*words, "--yes").err
    for wrong in ((), (next(iter(known)), "--only", "flagged")):
        assert "expected: either the ids of groups or --only" in cli("review", "reject", *wrong, *JANE).err


def test_remarks_and_flags_are_stored_and_removed(cli: Cli, root: Path, known: dict[str, str]) -> None:
    first, second, *_ = known
    cli("review", "approve", first, *JANE)
    cli("review", "remark", first, second, *JANE, "--text", "why not\nbelow?")
    assert cli("review", "flag", second, "--by", "Joe").out.startswith(f"{second} new, flagged\n")
    assert ids(cli, "--only", "flagged") == [second]
    shown = cli("review", "show", second).out
    assert re.search(r"^flagged by Joe on 20..-..-..$", shown, re.MULTILINE)
    assert re.search(r"^Jane Doe on 20..-..-..: why not below\?$", shown, re.MULTILINE)
    assert cli("review", "clear", first, *JANE, "--remark", "looked at the wrong one").code == 0
    [data] = cli("review", "show", first, "--json").json
    assert (data["state"], data["by"], len(data["remarks"])) == ("new", None, 2)
    cli("review", "unflag", second, *JANE)
    assert ids(cli, "--only", "flagged") == []
    assert "--text: no text" in cli("review", "remark", first, *JANE, "--text", " ").err


def test_the_status_shows_which_groups_are_left(cli: Cli, root: Path, known: dict[str, str]) -> None:
    gap = about(known, "offset(by, low, target=gap)")
    cli("review", "approve", *known, *JANE)
    cli("review", "flag", gap, *JANE)
    assert "all groups of small are approved" in cli("review", "status", "--campaign", "small").out
    spec = root / "fault_library/faults/sensor/distance.yaml"
    spec.write_text(spec.read_text().replace("[450, 459]", "[500, 509]"))
    changed = "values (by: -509 to -400; approved -459 to -400)"
    lines = cli("review", "status").out.splitlines()
    assert lines[0].endswith("toycar.yaml: 5 groups: 1 changed, 4 approved")
    assert lines[1] == "changed since the decision:"
    assert lines[2].startswith(f"  {gap}  approved by Jane Doe on ") and f"since: {changed})" in lines[2]
    assert lines[3:] == ["flagged:", f"  {gap}  by Jane Doe: {known[gap]}"]
    told = cli("review", "status", "--campaign", "small").out
    assert re.search(
        rf"^approvals that small lacks:\n  {gap}  changed \({re.escape(changed)}\), \d+ exp",
        told,
        re.MULTILINE,
    )
    facts = cli("review", "status", "--json").json
    assert facts["states"] == {"new": 0, "changed": 1, "rejected": 0, "approved": 4}
    assert [one["group"] for one in facts["lacking"]] == [gap]


def test_a_changed_group_shows_the_diff_since_its_approval(
    cli: Cli, root: Path, known: dict[str, str]
) -> None:
    gap = about(known, "offset(by, target=gap)")
    assert "no decision yet" in cli("review", "show", gap, "--changes").out
    cli("review", "approve", gap, *JANE)
    assert "nothing has changed since" in cli("review", "show", gap, "--changes").out
    template = root / "templates/offset.py.j2"
    template.write_text(template.read_text().replace("{{ by | signed }}", "{{ by | signed }} + 0.0"))
    shown = cli("review", "show", gap, "--changes").out
    assert "++            gap = gap ⟨⟩ ⟨⟩  # fi:⟨⟩" in shown
    assert "-    {{ target }} = {{ target }} {{ by | signed }}\n" in shown
    assert shown.count("gap = gap") == 2
    shutil.rmtree(root / "fault_library/reviews/seen")
    assert "the diff that the reviewer saw was not kept" in cli("review", "show", gap, "--changes").out


def test_a_mistake_in_the_review_file_is_reported_at_its_line(
    cli: Cli, root: Path, known: dict[str, str]
) -> None:
    cli("review", "approve", next(iter(known)), *JANE)
    file = root / "fault_library/reviews/toycar.yaml"
    good = file.read_text()
    for line, old, new in ((8, "approved", "okay"), (9, "Jane Doe", " ")):
        file.write_text(good.replace(old, new))
        answer = cli("review")
        assert (answer.code, f"toycar.yaml:{line}: " in answer.err) == (2, True)


def test_a_walk_needs_a_terminal(cli: Cli, root: Path) -> None:
    answer = cli("review", "walk", *JANE)
    assert answer.code == 2
    assert "no terminal to ask for decisions" in answer.err
    assert "mutator review approve" in answer.err


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Simulate a user who presses these keys and types these remarks."""

    class Tty:
        def __init__(self, stream: Any) -> None:
            self._stream = stream

        def __getattr__(self, name: str) -> Any:
            return (lambda: True) if name == "isatty" else getattr(self._stream, name)

    def press(pressed: str, *remarks: str) -> None:
        left: Iterator[str] = iter(pressed)
        said = iter(remarks)
        sys = review_walk.sys
        monkeypatch.setattr(
            review_walk, "sys", type("Sys", (), {"stdin": Tty(sys.stdin), "stdout": Tty(sys.stdout)})
        )
        monkeypatch.setattr(typer, "getchar", lambda: next(left))
        monkeypatch.setattr(typer, "prompt", lambda *a, **k: next(said))

    return press


def test_a_walk_asks_about_each_group(
    cli: Cli, root: Path, keys: Callable[..., None], known: dict[str, str]
) -> None:
    first, second, third, *_ = known
    keys("axrsq", "good", "too large")
    answer = cli("review", "walk", *JANE)
    assert answer.code == 0
    assert "1 of 5:  [a] approve  [r] reject  [s] skip  [q] quit" in answer.out
    states = {group["group"]: group["state"] for group in cli("review", "--json").json}
    assert [states[name] for name in (first, second, third)] == ["approved", "rejected", "new"]
    assert f"{second} rejected by Jane Doe" in answer.out and "(too large)" in answer.out
    keys("q")
    again = cli("review", "walk", *JANE, "--only", 'model != "omission"').out
    assert f"group {first}" not in again


def test_a_walk_asks_again_if_another_reviewer_decides(
    cli: Cli, root: Path, keys: Callable[..., None], known: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, *_ = known
    keys("aaq", "", "")
    ask = typer.getchar
    others = iter([lambda: main(["review", "reject", first, "--by", "Joe"])])

    def pressed() -> str:
        next(others, lambda: 0)()
        return ask()

    monkeypatch.setattr(typer, "getchar", pressed)
    answer = cli("review", "walk", *JANE)
    assert answer.code == 0
    assert f"  {first}  rejected by Joe on" in answer.err
    assert answer.out.count("1 of 5:") == 2
    assert cli("review", "show", first, "--json").json[0]["by"] == "Jane Doe"


def test_ctrl_d_ends_a_walk_without_a_decision(
    cli: Cli, root: Path, keys: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def over() -> str:
        raise EOFError

    keys("")
    monkeypatch.setattr(typer, "getchar", over)
    answer = cli("review", "walk", *JANE)
    assert (answer.code, answer.err) == (0, "")
    assert {group["state"] for group in cli("review", "--json").json} == {"new"}


def test_the_page_is_one_self_contained_file(
    cli: Cli, root: Path, tmp_path: Path, known: dict[str, str]
) -> None:
    out = tmp_path / "review.html"
    first = next(iter(known))
    cli("review", "approve", first, *JANE)
    words = ("--campaign", "small", "--reading", "as_coded")
    assert cli("review", "page", "--out", out, *words, "--json").json["groups"] == 4
    text = out.read_text()
    assert not re.search(r'(src|href)="(?!data:|#)', re.sub(r"<script.*?</script>", "", text, flags=re.S))
    [packed] = re.findall(r'<script type="application/octet-stream\+gzip" id="review">(.*?)</script>', text)
    data = json.loads(gzip.decompress(base64.b64decode(packed)))
    assert data["options"] == "--campaign small --reading as_coded"
    groups = {group["id"]: group for group in data["groups"]}
    for shown in cli("review", "show", *groups, *words, "--json").json:
        told = groups[shown["group"]]
        assert (told["diff"], told["state"], told["runs"]) == (shown["diff"], shown["state"], shown["runs"])
        assert [dict(zip(told["heads"], row, strict=True)) for row in told["rows"]] == shown["values"]
    again = out.with_name("again.html")
    cli("review", "page", "--out", again, *words)
    assert again.read_bytes() == out.read_bytes()
    assert cli("review", "page", "--out", tmp_path / "no" / "page.html").code == 2


@pytest.mark.slow
def test_only_approved_groups_run(cli: Cli, root: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = ("run", "small", "--out", out, "--require-reviewed")
    refused = cli(*words)
    assert (refused.code, (out / "run.json").exists()) == (1, False)
    groups = ids(cli, "--campaign", "small")
    assert f"{len(groups)} groups of mutants are not approved" in refused.err
    for group in cli("review", "--campaign", "small", "--json").json:
        assert re.search(rf"{group['group']}  missing, {group['runs']} experiments?: ", refused.err)
    assert "review them: `mutator review walk --campaign small --by NAME`" in refused.err
    command = re.search(r"`mutator (review approve .*) --by NAME`", refused.err)
    assert command is not None
    cli(*command[1].split(), *JANE)
    assert cli("review", "reject", groups[0], "--by", "Joe").code == 0
    refused = cli(*words)
    assert refused.code == 1
    assert "a group of mutants is not approved" in refused.err
    assert f"{groups[0]}  rejected" in refused.err
    cli("review", "approve", groups[0], "--by", "Joe")
    assert cli(*words).code == 0
    kept = json.loads((out / "reviewed.json").read_text())
    assert sorted(entry["group"] for entry in kept["groups"]) == sorted(groups)
    assert {entry["by"] for entry in kept["groups"]} == {"Jane Doe", "Joe"}
    assert cli(*words).code == 0  # again, with nothing left to do

    template = root / "templates/omission.py.j2"
    template.write_text(template.read_text().replace("not ", "not not not "))
    refused = cli("run", "small", "--out", tmp_path / "other", "--require-reviewed")
    assert refused.code == 1
    changed = [
        g["group"] for g in cli("review", "--campaign", "small", "--json").json if g["state"] == "changed"
    ]
    assert changed
    assert re.findall(r"^  (\w{12})  (\w+)", refused.err, re.MULTILINE) == [
        (name, "changed") for name in changed
    ]
    shutil.rmtree(root / "fault_library/reviews")
    assert cli("run", "small", "--out", out, "--require-reviewed").code != 0
