"""The number of instructions of a control step, which no other process on the machine can change."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = 48_900
"""Instructions of one step of the recorded run, mean over steps 1000 to 3000, rustc 1.95, x86-64."""
TOLERANCE = 1.25  # other compilers; a step that does more work is well above


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
@pytest.mark.skipif(shutil.which("cargo") is None, reason="cargo is not installed")
@pytest.mark.timeout(900)
def test_a_step_takes_no_more_instructions_than_it_did(tmp_path: Path) -> None:
    command = ["cargo", "build", "--quiet", "--release", "--package", "fg-core", "--example", "replay"]
    subprocess.run(command, cwd=ROOT, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    program = target / "release" / "examples" / "replay"

    def count(rows: int) -> int:
        tool = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={tmp_path / 'out'}"]
        run = subprocess.run([*tool, str(program), str(rows)], check=True, capture_output=True, text=True)
        found = re.search(r"Collected\s*:\s*(\d+)", run.stderr)
        assert found is not None, run.stderr
        return int(found.group(1))

    each = (count(3000) - count(1000)) / 2000
    print(f"{each:.0f} instructions a step")
    assert each < TOLERANCE * REFERENCE
