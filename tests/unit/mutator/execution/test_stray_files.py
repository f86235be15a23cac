"""Files that a run leaves in shared folders are named."""

from pathlib import Path

from mutator.execution.stray_files import StrayFiles

LARGE = bytes(1 << 20)


def test_only_large_new_files_are_named(tmp_path: Path) -> None:
    for folder in ("one", "other"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "before").touch()
    left = StrayFiles([tmp_path / "one", tmp_path / "other", tmp_path / "missing"])
    assert left.remark_on_new_files() == ""
    (tmp_path / "one" / "mutator-scratch").write_bytes(LARGE)
    (tmp_path / "one" / "small").touch()
    assert left.remark_on_new_files() == ""
    for number in range(4):
        (tmp_path / "other" / f"left{number}").write_bytes(LARGE)
    (tmp_path / "other" / "left4").mkdir()
    (tmp_path / "other" / "left4" / "file").write_bytes(LARGE)
    names = ", ".join(str(tmp_path / "other" / f"left{number}") for number in range(3))
    assert f"{names} and 2 more" in left.remark_on_new_files()
