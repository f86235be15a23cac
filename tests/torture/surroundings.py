"""Surroundings of a command: locales and clocks, little disk, memory or file handles, and closed streams.
Each is a context manager that takes a random generator and the case's folder. The command starts within
it."""

import os
import subprocess
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from .damages import Chance

CLOCK = """
import os, random, time
chance, real, shift = random.Random(os.environ["JUMPS"] + str(os.getpid())), time.time, [0.0]
def jumping():
    if chance.random() < 0.2:
        shift[0] = chance.uniform(-3e5, 3e5)
    return real() + shift[0]
time.time = jumping
time.time_ns = lambda: int(jumping() * 1e9)
"""
LIMIT = "import resource\nresource.setrlimit(resource.RLIMIT_{name}, ({most}, {most}))"
# otherwise root could raise its limits again
NO_PRIVILEGE = "import ctypes\nctypes.CDLL(None).prctl(24, 24, 0, 0, 0)"
NOBODY_READS = "import os\nread, write = os.pipe()\nos.close(read)\nfor fd in {fds}: os.dup2(write, fd)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Surrounding:
    """The environment of a command, code that its process runs first, and the run's folder. `ease` removes
    the difficulty. `is_heard` says whether its messages can be read."""

    run_in: Path
    how: str
    environment: dict[str, str] = field(default_factory=dict)
    before: str = ""
    ease: Callable[[], None] = lambda: None
    is_heard: bool = True


@contextmanager
def words(chance: Chance, at: Path) -> Iterator[Surrounding]:
    """Environment variables unrelated to results, and non-ASCII names."""
    locale = chance.choice(["C", "POSIX", "C.UTF-8", "xx_YY.UTF-8", "de_DE.ISO-8859-1", "tr_TR.UTF-8", ""])
    given = {
        "LC_ALL": locale,
        "LANG": locale,
        "TZ": chance.choice(["UTC", "Asia/Kathmandu", "<+14>-14", "no/where", ""]),
        "PYTHONHASHSEED": str(chance.randrange(2**32)),
        "PYTHONOPTIMIZE": chance.choice(["", "1", "2"]),
    }
    if chance.random() < 0.7:
        given |= {"PYTHONUTF8": chance.choice(["0", "1"]), "PYTHONCOERCECLOCALE": chance.choice(["0", "1"])}
    name = chance.choice(["plain", "é ☃", "-n", "a'b\"c", "new\nline", "%s{x}", "x" * 200])
    yield Surrounding(run_in=at / name, how=f"{name!r} {given}", environment=given)


@contextmanager
def clock(chance: Chance, at: Path) -> Iterator[Surrounding]:
    (at / "sitecustomize.py").write_text(CLOCK)
    given = {"PYTHONPATH": str(at), "JUMPS": str(chance.random())}
    yield Surrounding(run_in=at, how="jumps", environment=given)


def _limit(name: str, least: int, most: int) -> Callable[..., AbstractContextManager[Surrounding]]:
    @contextmanager
    def limit(chance: Chance, at: Path) -> Iterator[Surrounding]:
        number = int(least * (most / least) ** chance.random())
        before = "\n".join((NO_PRIVILEGE, LIMIT.format(name=name, most=number)))
        yield Surrounding(run_in=at, how=f"RLIMIT_{name} of {number}", before=before)

    return limit


@contextmanager
def disk(chance: Chance, at: Path) -> Iterator[Surrounding]:
    role, place = chance.choice(["run", "run", "TMPDIR", "XDG_CACHE_HOME"]), at / "disk"
    size, inodes = f"size={int(2 ** chance.uniform(13, 22))}", f"nr_inodes={int(2 ** chance.uniform(1, 9))}"
    small = chance.choice([size, size, inodes])
    with mounted(place, small):
        yield Surrounding(
            run_in=place if role == "run" else at,
            how=f"{role} on a disk with {small}",
            environment={} if role == "run" else {role: str(place)},
            ease=lambda: _mount("-o", "remount,size=64m,nr_inodes=100k", str(place)),
        )


@contextmanager
def read_only(chance: Chance, at: Path) -> Iterator[Surrounding]:
    role, place = chance.choice(["run", "TMPDIR", "XDG_CACHE_HOME", "HOME"]), at / "disk"
    given = {} if role == "run" else {role: str(place)}
    if role == "HOME":
        given |= {"XDG_CACHE_HOME": ""}
    with mounted(place, "ro"):
        yield Surrounding(
            run_in=place if role == "run" else at,
            how=f"{role} on a read-only disk",
            environment=given,
            ease=lambda: _mount("-o", "remount,rw", str(place)),
        )


@contextmanager
def streams(chance: Chance, at: Path) -> Iterator[Surrounding]:
    fds = chance.choice([[0], [1], [2], [1, 2], [0, 1, 2]])
    how = chance.choice(["closed", "nobody reads", "full"])
    if how == "closed":
        before = f"import os\nfor fd in {fds}: os.close(fd)"
    elif how == "full":
        before = f"import os\nfull = os.open('/dev/full', os.O_RDWR)\nfor fd in {fds}: os.dup2(full, fd)"
    else:
        before = NOBODY_READS.format(fds=[fd for fd in fds if fd] or [1])
    yield Surrounding(run_in=at, how=f"{how}: {fds}", before=before, is_heard=2 not in fds)


SURROUNDINGS: dict[str, Callable[[Chance, Path], AbstractContextManager[Surrounding]]] = {
    "words": words,
    "clock": clock,
    "few files": _limit("NOFILE", 4, 100),
    "little memory": _limit("AS", 120 << 20, 3000 << 20),
    "full disk": disk,
    "read-only": read_only,
    "streams": streams,
}
MOUNTED = ("full disk", "read-only")


@contextmanager
def mounted(place: Path, options: str) -> Iterator[None]:
    place.mkdir()
    _mount("-t", "tmpfs", "-o", options, "tmpfs", str(place))
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)
        place.rmdir()


def may_mount(at: Path) -> bool:
    try:
        with mounted(at / "tried", "size=1m"):
            return True
    except (OSError, subprocess.CalledProcessError):
        (at / "tried").rmdir()
        return False


def _mount(*given: str) -> None:
    subprocess.run(["mount", *given], check=True, capture_output=True, env=os.environ | {"LC_ALL": "C"})
