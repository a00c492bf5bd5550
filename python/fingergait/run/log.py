"""What happened in a run, control step by control step: one table of numbers, in memory and as Parquet.

Truth, measurements and the core's diagnostics stand side by side; no time measurement is among them, so the same seed
gives the same file, byte for byte, on one machine. All columns but `t` are single precision: 4 nm in 10 cm.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from fingergait._core import ConfigError, Diagnostics
from fingergait.files import whole_file
from fingergait.sim.sensors import Sensors, joint_names

_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
_GROW = 4096  # rows added at a time


def columns(fingers: list[str], counts: list[int]) -> list[str]:
    """Names of a log's columns after `t`.

    `object_*`, `desired_*`: true and desired pose of the object in W. `q_*`: true joint angles, rad.
    `friction_force_*`: true tangential force at each tip, N. `link_contact`: 1 where another part of a finger than its
    tip touches the object. `measured_*`: what the sensors said. The rest: the core's
    `Diagnostics`.
    """
    joints = joint_names(fingers, counts)
    return [
        *(f"object_{name}" for name in _POSE),
        *(f"desired_{name}" for name in _POSE),
        *(f"q_{joint}" for joint in joints),
        *(f"friction_force_{name}" for name in fingers),
        "link_contact",
        *Sensors.columns(fingers, counts),
        *Diagnostics.columns(len(fingers), counts),
    ]


class Log:
    """Rows of one run.

    Parameters
    ----------
    names
        Columns after `t`.
    fingers
        Names of the fingers.
    capacity
        Rows to make room for at first.
    """

    def __init__(self, names: list[str], fingers: list[str], capacity: int = _GROW) -> None:
        self.names = names
        self.fingers = fingers
        self.metadata: dict[str, str] = {}
        self._index = {name: i for i, name in enumerate(names)}
        self._t = np.empty(capacity)
        self._rows = np.empty((capacity, len(names)), dtype=np.float32)
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def append(self, t: float) -> NDArray[np.float32]:
        """The new row of time t, to be filled in."""
        if self._length == len(self._t):
            self._t = np.concatenate([self._t, np.empty(_GROW)])
            self._rows = np.concatenate([self._rows, np.empty((_GROW, len(self.names)), dtype=np.float32)])
        self._t[self._length] = t
        self._length += 1
        row: NDArray[np.float32] = self._rows[self._length - 1]
        return row

    @property
    def t(self) -> NDArray[np.float64]:
        """Times, s."""
        return self._t[: self._length]

    def raw(self) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Times and rows as they lie in memory, with room for more behind; for readers of a log that grows."""
        return self._t, self._rows

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The column called `name`."""
        return self._rows[: self._length, self._index[name]].astype(np.float64)

    def last(self, name: str) -> float:
        """The newest number in the column called `name`."""
        return float(self._rows[self._length - 1, self._index[name]])

    def block(self, prefix: str) -> NDArray[np.float64]:
        """The columns called `prefix`_something, side by side in their order, (rows, n)."""
        picked = [i for name, i in self._index.items() if name.startswith(f"{prefix}_")]
        return self._rows[: self._length, picked].astype(np.float64)

    def pose(self, prefix: str) -> NDArray[np.float64]:
        """The pose columns of `prefix`, (rows, 7)."""
        picked = [self._index[f"{prefix}_{name}"] for name in _POSE]
        return self._rows[: self._length, picked].astype(np.float64)

    def write(self, path: Path) -> None:
        """Writes the log with its metadata as one Parquet file."""
        columns = [pa.array(self.t), *(pa.array(self._rows[: self._length, i]) for i in range(len(self.names)))]
        metadata = {"fingers": ",".join(self.fingers), **self.metadata}
        schema = pa.schema(
            [("t", pa.float64()), *((name, pa.float32()) for name in self.names)],
            metadata=metadata,
        )
        with whole_file(path) as temporary, temporary.open("wb") as file:
            pq.write_table(pa.Table.from_arrays(columns, schema=schema), file, compression="zstd")

    @classmethod
    def read(cls, path: Path) -> "Log":
        """The log in a Parquet file that `write` wrote."""
        try:
            with path.open("rb") as file:
                table = pq.read_table(file)
        except (OSError, pa.ArrowInvalid) as error:
            raise ConfigError(f"{path}: expected a log in Parquet, found: {' '.join(str(error).split())}") from None
        metadata = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}
        if "fingers" not in metadata or table.schema.names[:1] != ["t"]:
            raise ConfigError(f"{path}: expected a log of fingergait, found other columns")
        log = cls(table.schema.names[1:], metadata.pop("fingers").split(","), max(1, table.num_rows))
        log.metadata = metadata
        log._t[:] = table.column(0).to_numpy()
        for i in range(len(log.names)):
            log._rows[:, i] = table.column(i + 1).to_numpy()
        log._length = table.num_rows
        return log


def describe(values: dict[str, Any]) -> str:
    """Metadata as compact JSON with sorted keys."""
    return json.dumps(values, sort_keys=True, separators=(",", ":"))
