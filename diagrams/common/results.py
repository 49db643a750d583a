"""What a run leaves: a folder for one run at a time, each file whole or not there."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from copy import deepcopy
import dataclasses
import fcntl
from pathlib import Path
import re
import shutil
from time import sleep
from typing import IO, Any

import yaml

from diagrams.common.scenario import ScenarioError, refusals
from plants.tissue.dicom import files_of
from plants.tissue.segments import is_dicom
from systems.common.archive import whole

LOCK = ".run"
"""The file that is locked while a run writes; it lists what the run wrote."""

INPUTS = "inputs"
"""Where copies of the files that a scenario names are kept, apart from results."""

_PATIENCE = 20
"""Times that a lock is tried: a process that was killed may take a second to go."""

LARGEST_INPUT = 1_000_000_000
"""Of a file that a scenario names, in bytes."""

_DATA = re.compile(
    rb"^(?:ElementDataFile\s*=|data ?file:)\s*([^\r\n]*?)\s*$", re.I | re.M
)
"""Where a header of MetaImage or NRRD names the file of its voxels."""


class Results:
    """A folder that a run writes to, see `results`."""

    def __init__(self, folder: Path, written: IO[str]) -> None:
        self.folder = folder
        self._written = written

    def clear(self, kept: set[Path]) -> None:
        """Removes what the run before wrote, so that no two runs are mixed.

        Args:
            kept: Files that stay, for this run reads them.
        """
        self._written.seek(0)
        usual = ["scenario.yaml", "signals.csv", "metrics.json", "replay.html"]
        for name in [*usual, *self._written.read().splitlines()]:
            path = self.folder / name
            is_within = path.parent.resolve().is_relative_to(self.folder.resolve())
            if is_within and path.resolve() not in kept and path.name != LOCK:
                with suppress(IsADirectoryError, NotADirectoryError):
                    path.unlink(missing_ok=True)
        self._written.truncate(0)

    @contextmanager
    def file(self, name: str) -> Iterator[Path]:
        """Where to write a result; it has its name once it is whole."""
        self._written.write(f"{name}\n")
        self._written.flush()
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as draft:
            yield draft

    def copy(self, source: Path, name: str) -> None:
        """Keeps a copy of a file that the run reads.

        Raises:
            ScenarioError: If it is no regular file, or too large.
        """
        if not source.is_file():
            raise ScenarioError(f"{str(source)!r}: expected a regular file")
        size = source.stat().st_size
        if size > LARGEST_INPUT:
            raise ScenarioError(
                f"{str(source)!r} has {size} bytes: expected at most {LARGEST_INPUT}"
            )
        target = self.folder / name
        if target.exists() and target.samefile(source):
            self._written.write(f"{name}\n")
            return
        with self.file(name) as draft:
            shutil.copyfile(source, draft)


def _locked(stream: IO[str]) -> bool:
    """Whether a file could be locked; if not, some time has passed."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        sleep(0.1)
        return False
    return True


@contextmanager
def results(folder: Path) -> Iterator[Results]:
    """Makes a folder of results, and keeps other runs out of it meanwhile.

    The lock is the process's and ends with it, however that ends.

    Raises:
        ScenarioError: If it cannot be written, or another run writes to it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        stream = (folder / LOCK).open("a+", encoding="utf-8")
    except OSError as error:
        raise ScenarioError(
            f"cannot write to the output folder {str(folder)!r}: {error.strerror}"
        ) from error
    with stream:
        if not any(_locked(stream) for _ in range(_PATIENCE)):
            raise ScenarioError(
                f"another run writes to {str(folder)!r}: expected a folder of its own, "
                "see --out"
            )
        yield Results(folder, stream)


def save_scenario(scenario: Any, into: Results) -> Path:
    """Writes `scenario.yaml` and, below `inputs`, copies of the files it names.

    What an earlier run left in the folder goes. Two files of one name are kept in
    folders of their own, since a header may name its data.

    Returns:
        The file; loading it repeats the run.

    Raises:
        ScenarioError: If a file that is named cannot be copied.
    """
    copy = deepcopy(scenario)
    copies: dict[str, Path] = {}
    for owner, name in files(copy):
        first, *rest = with_data(Path(getattr(owner, name)).absolute())
        parts = {first.name: first}
        for p in rest:
            apart = "" if p.parent == first.parent else f"{p.parent.name}/"
            parts[f"{apart}{p.name}"] = p
        folder, number = INPUTS, 1
        while any(copies.get(f"{folder}/{n}", p) != p for n, p in parts.items()):
            number += 1
            folder = f"{INPUTS}/{number}"
        copies |= {f"{folder}/{n}": p for n, p in parts.items()}
        setattr(owner, name, f"{folder}/{first.name}")
    into.clear({path.resolve() for path in copies.values()})
    for name, path in copies.items():
        into.copy(path, name)
    with into.file("scenario.yaml") as draft:
        draft.write_text(yaml.safe_dump(dataclasses.asdict(copy), sort_keys=False))
    return into.folder / "scenario.yaml"


def files(params: Any) -> Iterator[tuple[Any, str]]:
    """Every field that names a file: the dataclass it is in, and its name there."""
    for field in dataclasses.fields(params):
        value, told = getattr(params, field.name), field.metadata.get("parameter")
        if told and told.file and value:
            yield params, field.name
        for item in value if isinstance(value, list) else [value]:
            if dataclasses.is_dataclass(item):
                yield from files(item)


def with_data(path: Path) -> list[Path]:
    """A file, and those that belong to it: a MetaImage's voxels, an RTSTRUCT's CT.

    Raises:
        ScenarioError: If its header names a file elsewhere, or several.
    """
    if path.is_file() and is_dicom(path):
        with refusals():
            return files_of(path)
    if path.suffix.lower() not in (".mhd", ".nhdr") or not path.is_file():
        return [path]
    with path.open("rb") as stream:
        told = _DATA.search(stream.read(65536))
    name = told.group(1).decode("utf-8", "replace") if told else "LOCAL"
    if name.upper() == "LOCAL":
        return [path]
    if Path(name).name != name or name.upper().split()[0] == "LIST":
        raise ScenarioError(
            f"{str(path)!r}: data file {name!r}: expected one file beside it"
        )
    return [path, path.with_name(name)]
