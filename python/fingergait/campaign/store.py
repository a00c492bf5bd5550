"""The data set of a campaign: Parquet files that appear whole or not at all, so that a killed campaign can go on.

The folder holds `campaign.json` (what is being run), `data/` (one row a run, nothing in it that a clock or a host could
change), `timing/` (how long each run took) and, at the end, `report.html` and `summary.json`.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from uuid import uuid4

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from fingergait._core import ConfigError
from fingergait.campaign.trial import METRICS, OBSERVED
from fingergait.files import make_folder, whole_file, write_text

_TYPES = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string()}
_MERGE = 256  # parts that become one

TIMING = pa.schema(
    [
        ("index", pa.int64()),
        ("wall_s", pa.float64()),
        ("cpu_s", pa.float64()),
        ("real_time_factor", pa.float64()),
        ("step_p999_us", pa.float64()),
        ("deadline_misses", pa.int64()),
        ("attempts", pa.int64()),
    ]
)


def row_schema(drawn: dict[str, bool]) -> pa.Schema:
    """Columns of a row: index, seed, fault, the drawn values under `x.`, then what came of it and how to repeat it.

    `drawn` says of each drawn value whether it is a number.
    """
    outcome = {"status": str, "error": str, "cause": str, **METRICS, **OBSERVED, "replay": str}
    return pa.schema(
        [
            ("index", pa.int64()),
            ("seed", pa.int64()),
            ("fault", pa.string()),
            ("promise", pa.string()),
            *((f"x.{name}", pa.float64() if number else pa.string()) for name, number in drawn.items()),
            *((name, _TYPES[kind]) for name, kind in outcome.items()),
        ]
    )


class Store:
    """The folder of one campaign.

    Parameters
    ----------
    folder
        Where.
    manifest
        What the campaign is; a resumed one must say the same.
    schema
        Of the rows.
    resume
        Whether to go on with what is there.

    Raises
    ------
    ConfigError
        Where the folder holds a campaign and `resume` is not given, or another campaign, or can't be written.
    """

    def __init__(self, folder: Path, manifest: dict[str, Any], schema: pa.Schema, resume: bool) -> None:
        self.folder, self._schema = folder, schema
        self._parts = {"data": schema, "timing": TIMING}
        make_folder(folder)
        for name in self._parts:
            make_folder(folder / name)
        path = folder / "campaign.json"
        if path.is_file() and (resume or any((folder / "data").glob("[!.]*.parquet"))):
            _compare(json.loads(path.read_text(encoding="utf-8")), manifest, folder, resume)
        elif resume:
            raise ConfigError(f"--resume: expected the folder of a campaign, found none in {folder}")
        for left in folder.glob("*/.*.tmp*"):
            left.unlink()
        write_text(path, json.dumps(manifest, indent=2, sort_keys=True) + "\n")

    def done(self) -> set[int]:
        """Indices of the runs that have a row."""
        return set(self._read("data", ["index"]).column("index").to_pylist())

    def add(self, rows: Sequence[dict[str, Any]], timings: Sequence[dict[str, Any]]) -> None:
        """Adds rows that belong together; after this they survive a kill."""
        # Times go first: a row says that its run is done.
        for name, records in (("timing", timings), ("data", rows)):
            table = pa.Table.from_pylist(list(records), schema=self._parts[name])
            _write(table, self.folder / name, f"part-{min(row['index'] for row in rows):09d}.parquet")
            self._merge(name, "part-*.parquet", _MERGE)

    def finish(self) -> pa.Table:
        """All rows in the order of their index, now in one file."""
        for name in self._parts:
            self._merge(name, "[!.]*.parquet", 2)
        return self.rows()

    def rows(self) -> pa.Table:
        """All rows in the order of their index."""
        return self._read("data")

    def timings(self) -> pa.Table:
        """How long each run took, in the order of the index."""
        return self._read("timing")

    def _read(self, name: str, columns: list[str] | None = None) -> pa.Table:
        return self._table(name, sorted((self.folder / name).glob("[!.]*.parquet")), columns)

    def _table(self, name: str, files: list[Path], columns: list[str] | None = None) -> pa.Table:
        if not files:
            table = self._parts[name].empty_table()
            return table if columns is None else table.select(columns)
        tables = []
        for file in files:
            with file.open("rb") as source:
                tables.append(pq.read_table(source, columns=columns))
        return _unique(pa.concat_tables(tables))

    def _merge(self, name: str, pattern: str, least: int) -> None:
        """Puts `least` or more files into one. A kill in between leaves rows twice, which reading sorts out."""
        files = sorted((self.folder / name).glob(pattern))
        if len(files) >= least:
            _write(self._table(name, files), self.folder / name, f"rows-{uuid4().hex}.parquet")
            for file in files:
                file.unlink()


def _unique(table: pa.Table) -> pa.Table:
    """The table sorted by index, each index once."""
    table = table.sort_by("index")
    index = table.column("index").combine_chunks()
    if len(index) < 2:
        return table
    new = pc.not_equal(index[1:], index[:-1])
    return table.filter(pa.concat_arrays([pa.array([True]), new]))


def _write(table: pa.Table, folder: Path, name: str) -> None:
    with whole_file(folder / name) as temporary, temporary.open("wb") as file:
        pq.write_table(table, file, compression="zstd")


def _compare(found: dict[str, Any], wanted: dict[str, Any], folder: Path, resume: bool) -> None:
    if not resume:
        raise ConfigError(f"--out: expected a folder without a campaign, or --resume, found a campaign in {folder}")
    differing = sorted(key for key in {*found, *wanted} if found.get(key) != wanted.get(key))
    if differing:
        raise ConfigError(f"--resume: expected the campaign of {folder}, found another {' and '.join(differing)}")
