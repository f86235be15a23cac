"""Puts into the wheel what ships with the harness; everything else about the build is in pyproject.toml."""

import shutil
from pathlib import Path
from zipfile import ZipFile, ZipInfo

from setuptools import setup
from setuptools.command.build_py import build_py

CLONE = Path(__file__).parent
SHIPPED = ("target", "fault_library", "templates")
ARCHIVE = Path("mutator", "_common", "shipped.zip")  # where mutator/_common/shipped.py looks for it


class BuildWithShipped(build_py):
    """Builds the packages and, unless the install is editable, the archive of what ships with them."""

    def run(self) -> None:
        if not self.editable_mode:
            shutil.rmtree(self.build_lib, ignore_errors=True)  # modules of an earlier build stay out
        super().run()
        if not self.editable_mode:
            archive = Path(self.build_lib) / ARCHIVE
            archive.parent.mkdir(parents=True, exist_ok=True)
            write_archive(archive)


def write_archive(path: Path) -> None:
    """Write the same bytes for the same files: sorted, undated, uncompressed (the wheel compresses it)."""
    with ZipFile(path, "w") as archive:
        for file in sorted(file for folder in SHIPPED for file in (CLONE / folder).rglob("*")):
            name = file.relative_to(CLONE)
            hidden = any(part.startswith((".", "__pycache__")) for part in name.parts)
            if file.is_file() and not hidden and file.suffix != ".pyc":
                archive.writestr(ZipInfo(name.as_posix()), file.read_bytes())


setup(cmdclass={"build_py": BuildWithShipped})
