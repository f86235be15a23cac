"""The authors' fault files are parsed as data; one that is not in their format is an error with its line."""

import os
import shutil
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.paper.uva_files import Change, read_fault_files

FILES = Path(__file__).parents[3] / "fixtures" / "uva"
TITLE = "title:1_d_rel-add-incRADAR-H1\n"
LOCATION = "location//selfdrive/test/plant/plant.py//#radar_dRel:HOOK#\n"
FAULT = "fault 1//if self.headway_time<=1.5://radar_dRel+=12\n"
COUNT = "Total number of fault cases: 1"


def folder_with(tmp_path: Path, text: str | bytes, name: str = "scenario_1.txt") -> Path:
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return tmp_path


def test_files_are_read_by_number_with_all_their_lines() -> None:
    files, ignored = read_fault_files(FILES)
    assert [(file.number, file.aim, file.hook, len(file.lines)) for file in files] == [
        (1, "H1", "radar_dRel", 3),
        (6, "H2", "radar_none", 1),
        (15, "H3", "md", 2),
        (52, "H3", "visionFault", 4),
        (53, "H3", "md_none", 1),
    ]
    assert ignored == {}
    assert [line.line for line in files[0].lines] == [3, 4, 5]
    assert files[0].lines[1].changes == (Change(variable="radar_dRel", operator="+=", number=71.5),)
    assert files[1].lines[0].changes == () and not files[1].lines[0].problem
    assert [change.number for change in files[2].lines[0].changes] == [-0.25, 0.5]


def test_the_folder_of_the_files_is_found_too_and_other_texts_are_named(tmp_path: Path) -> None:
    copy = shutil.copytree(FILES / "fault_library", tmp_path / "files")
    shutil.copyfile(copy / "scenario_1.txt", copy / "scenario_1 (copy).txt")
    files, ignored = read_fault_files(copy)
    assert len(files) == 5
    assert ignored == {"scenario_1 (copy).txt": "its name is not scenario_<number>.txt"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ":1: ''; expected `title:"),
        ("\0" * 50, ":1: '\\x00"),
        (b"\xff\xfe" + TITLE.encode(), "no UTF-8 at byte 0"),
        (TITLE.replace("1_", "2_") + LOCATION + FAULT + COUNT, ":1: title number 2; expected 1"),
        (TITLE.replace("H1", "H9") + LOCATION + FAULT + COUNT, ":1: 'title:1_d_rel-add-incRADAR-H9'"),
        (TITLE + FAULT + COUNT, ":2: 'fault 1//if self.headway_time<=1.5://radar_dRel+=12'; expected `loc"),
        (
            TITLE + LOCATION + FAULT,
            ":3: 'fault 1//if self.headway_time<=1.5://radar_dRel+=12'; expected `Total",
        ),
        (TITLE + LOCATION + FAULT + "rm -rf\n" + COUNT, ":4: 'rm -rf'; expected `fault <number>"),
        (TITLE + LOCATION + FAULT + COUNT + "2", ":4: 1 fault; expected 12, as this line says; fetch the"),
        ("x" * 1_100_000, "1,100,000 bytes; expected at most 1,000,000 bytes"),
    ],
)
def test_a_file_in_another_format_is_an_error_with_its_line(
    tmp_path: Path, text: str | bytes, said: str
) -> None:
    with pytest.raises(MutatorError) as caught:
        read_fault_files(folder_with(tmp_path, text))
    assert said in str(caught.value) and "scenario_1.txt" in str(caught.value)


@pytest.mark.parametrize(
    ("statement", "problem"),
    [
        ("__import__('os').system('touch HERE')", "a statement that is not understood: __import__"),
        ("radar_dRel+=open('/etc/passwd')", "a statement that is not understood"),
        ("radar_dRel+=9999999999", "a number beyond 1e+06: 9999999999"),
        ("radar_dRel+=1e99", "a number beyond 1e+06: 1e99"),
        ("radar_dRel+=(5", "a statement that is not understood: radar_dRel+=(5"),
        ("radar_dRel+=5)", "a statement that is not understood: radar_dRel+=5)"),
        ("radar_dRel+=\u20285", "a statement that is not understood"),
        ("radar_dRel+=nan", "a statement that is not understood: radar_dRel+=nan"),
        ("radar_dRel+=" + "1" * 2000, "longer than 1000 characters"),
        ("", "not of the form"),
        ("if radar_dRel<0:", "no change of a variable"),
    ],
)
def test_a_line_that_cannot_be_understood_is_kept_with_its_problem(
    tmp_path: Path, statement: str, problem: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing in a line is executed, whatever it says."""
    monkeypatch.chdir(tmp_path)
    line = f"fault 1//if self.headway_time<=1.5://{statement}\n"
    files, _ = read_fault_files(folder_with(tmp_path, TITLE + LOCATION + line + COUNT))
    assert problem in files[0].lines[0].problem
    assert [path.name for path in tmp_path.iterdir()] == ["scenario_1.txt"]


def test_a_byte_order_mark_and_a_blank_last_line_are_no_fault(tmp_path: Path) -> None:
    """Editors add both."""
    text = f"\ufeff{TITLE}{LOCATION}{FAULT}{COUNT}\n\n".replace("\n", "\r\n")
    files, _ = read_fault_files(folder_with(tmp_path, text))
    assert [line.changes[0].number for line in files[0].lines] == [12]


@pytest.mark.parametrize("character", ["\f", "\v", "\x1c", "\x85", "\u2028"])
def test_lines_are_counted_as_editors_do(tmp_path: Path, character: str) -> None:
    """Only a line feed ends a line, so an error names the line that an editor shows."""
    bad = f"fault 1//if self.headway_time<=1.5{character}://none\n"
    with pytest.raises(MutatorError, match=r"scenario_1\.txt:4: 'wrong'"):
        read_fault_files(folder_with(tmp_path, f"{TITLE}{LOCATION}{bad}wrong\n{COUNT}"))


def test_a_repeated_number_of_a_fault_is_noticed(tmp_path: Path) -> None:
    again = FAULT.replace("12", "13")
    text = TITLE + LOCATION + FAULT + again + COUNT.replace("1", "2")
    files, _ = read_fault_files(folder_with(tmp_path, text))
    assert [line.problem for line in files[0].lines] == ["", "fault number 1, as in line 3"]


def test_folders_without_readable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="no such folder"):
        read_fault_files(tmp_path / "missing")
    with pytest.raises(MutatorError, match="no fault files"):
        read_fault_files(tmp_path)
    shutil.copytree(FILES / "fault_library", tmp_path / "deeper")  # is not searched
    with pytest.raises(MutatorError, match="no fault files"):
        read_fault_files(tmp_path)
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "scenario_1.txt").symlink_to("/etc/passwd")
    with pytest.raises(MutatorError, match=r"scenario_1\.txt"):
        read_fault_files(tmp_path / "a")
    (tmp_path / "b").mkdir()
    os.mkfifo(tmp_path / "b" / "scenario_1.txt")
    with pytest.raises(MutatorError, match="cannot be read"):
        read_fault_files(tmp_path / "b")
