"""Results of a campaign in Parquet: parts that are whole or not there.

    import pandas
    runs = pandas.read_parquet("out/operations/runs")

A row is a run of a variant. Its columns are `run`, `variant`, `seed`, `status` (done,
refused, error, died), `failed` (what it failed by, "" for nothing), `said` (the text of
a refusal, an error or a death), `draws` (what was drawn, as JSON), the figures, and
`more`, JSON of what fits no column. Once a campaign is complete its rows lie in one
part, sorted: equal bytes, however it came about.
"""

from collections.abc import Mapping
import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from systems.common.archive import whole

_PART = 500
"""Rows that are written at a time, if they are not asked for before."""
_MOST_PARTS = 100
"""Of which reading takes long."""

HEAD = {
    "run": pa.int64(),
    "variant": pa.string(),
    "seed": pa.int64(),
    "status": pa.string(),
    "failed": pa.string(),
    "said": pa.string(),
    "draws": pa.string(),
}


def schema(figures: Mapping[str, Any]) -> pa.Schema:
    """The columns for figures such as these; none stands for a number."""
    kinds: dict[str, pa.DataType] = dict(HEAD)
    for name, value in figures.items():
        if name in HEAD:  # a scenario's figures name the seed as well
            continue
        if isinstance(value, bool):
            kinds[name] = pa.bool_()
        elif isinstance(value, str):
            kinds[name] = pa.string()
        elif value is None or isinstance(value, int | float):
            kinds[name] = pa.float64()
        else:
            kinds[name] = pa.string()  # JSON
    return pa.schema([*kinds.items(), ("more", pa.string())])


class Store:
    """The rows of a campaign in a folder."""

    def __init__(self, folder: Path, figures: Mapping[str, Any]) -> None:
        """Opens the folder; parts that are there stay.

        Args:
            folder: Of the parts, made if it is not there.
            figures: Those of a run, which the columns are made for.
        """
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self._schema = schema(figures)
        self._lists = {k for k, v in figures.items() if isinstance(v, list | dict)}
        self._rows: list[dict[str, Any]] = []
        for draft in folder.glob("*.draft"):
            draft.unlink()

    def _parts(self) -> list[Path]:
        return sorted(self._folder.glob("*.parquet"))

    def done(self) -> set[tuple[int, str]]:
        """Run and variant of every row that is written."""
        found: set[tuple[int, str]] = set()
        for part in self._parts():
            columns = pq.read_table(part, columns=["run", "variant"]).to_pydict()
            found |= set(zip(columns["run"], columns["variant"], strict=True))
        return found

    def add(self, head: Mapping[str, Any], figures: Mapping[str, Any]) -> None:
        """Takes a row; it is written with others."""
        row, more = dict(head), {}
        for name, value in figures.items():
            if name in self._lists:
                row[name] = json.dumps(value)
            elif (
                name in self._schema.names
                and name not in HEAD
                and self._fits(name, value)
            ):
                row[name] = value
            else:
                more[name] = value
        row["more"] = json.dumps(more) if more else ""
        self._rows.append(row)
        if len(self._rows) >= _PART:
            self.flush()

    def _fits(self, name: str, value: Any) -> bool:
        kind = self._schema.field(name).type
        if value is None:
            return True
        if kind == pa.bool_():
            return isinstance(value, bool)
        if kind == pa.string():
            return isinstance(value, str)
        return isinstance(value, int | float) and not isinstance(value, bool)

    def flush(self) -> None:
        """Writes what was taken."""
        numbers = [int(part.stem) for part in self._parts()]
        if self._rows:
            self._write(max(numbers, default=0) + 1, self._table(self._rows))
            self._rows = []
        if len(numbers) > _MOST_PARTS:
            self._join()

    def _table(self, rows: list[dict[str, Any]]) -> pa.Table:
        return pa.Table.from_pylist(rows, self._schema)

    def _write(self, number: int, table: pa.Table) -> None:
        with whole(self._folder / f"{number:06d}.parquet") as draft:
            pq.write_table(table, draft)

    def read(self) -> pa.Table:
        """All rows that are written, sorted, each run of a variant once."""
        tables = [pq.read_table(part) for part in self._parts()]
        table = pa.concat_tables(tables) if tables else self._table([])
        keys = list(
            zip(*table.select(["run", "variant"]).to_pydict().values(), strict=True)
        )
        first = {key: place for place, key in reversed(list(enumerate(keys)))}
        return table.take(pa.array([first[key] for key in sorted(first)], pa.int64()))

    def rows(self) -> list[dict[str, Any]]:
        """All rows as plain data."""
        rows: list[dict[str, Any]] = self.read().to_pylist()
        return rows

    def keep(self, end: int) -> None:
        """Leaves out runs from `end` on: it was enough before."""
        self.flush()
        table = self.read()
        late = [run.as_py() >= end for run in table["run"]]
        if any(late):
            parts = self._parts()
            self._write(0, table.filter(pa.array([not one for one in late])))
            for part in parts:
                if part.stem != "000000":
                    part.unlink()

    def compact(self) -> None:
        """Makes one part of all."""
        self.flush()
        self._join()

    def _join(self) -> None:
        parts = self._parts()
        if parts and parts != [self._folder / "000000.parquet"]:
            self._write(0, self.read())
            for part in parts:
                if part.stem != "000000":
                    part.unlink()
