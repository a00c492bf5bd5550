"""A small campaign, and its data set in pandas: what do mass and friction do to the errors?

`fingergait campaign FILE.toml` does the same from the command line, with resumption and on a cluster.
"""

import sys
import tempfile
from pathlib import Path

import pandas as pd

from fingergait.campaign.command import Options, run_campaign
from fingergait.campaign.spec import CampaignSpec

SPEC = """
description = "Mass and friction."
scenario = "lift-and-rotate"
samples = 8
method = "sobol"

[set]
duration = 3.0

[vary]
"truth.mass_scale" = { uniform = [0.6, 1.4] }
"truth.friction" = { uniform = [0.6, 1.2] }
"""


def main(folder: Path) -> None:
    """Runs the campaign in `folder` and looks at its data."""
    file = folder / "mass-and-friction.toml"
    file.write_text(SPEC, encoding="utf-8")
    figures = run_campaign(CampaignSpec.load(file), Options(workers=2, out=folder / "results"))
    print(f"{figures['runs']} runs, {figures['drops']} dropped; the report: {figures['report']}")

    data = pd.read_parquet(figures["data"])  # a row a run; drawn values in the columns x.*
    data["error_mm"] = 1e3 * data["max_position_error_m"]
    shown = ["x.truth.mass_scale", "x.truth.friction", "status", "error_mm", "gaits"]
    print(data[shown].sort_values("error_mm").to_string(index=False, float_format="{:.3f}".format))
    print(f"to run the worst again: {data.loc[data['error_mm'].idxmax(), 'replay']}")


if __name__ == "__main__":  # the workers are processes, which import this file again
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()))
