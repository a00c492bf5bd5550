"""Every example runs, from another folder, and warns of nothing; the notebook shows what it promises."""

import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parents[1] / "examples"
# What a script prints at least, so that one that runs on empty is noticed.
PRINTS = {
    "turn": "gaits, object held",
    "own_scenario": "refused: pushed-box: object.mass",
    "own_plant": "largest position error",
    "force_optimizer": "solved by active_set",
    "gait_lp": "feasible: True",
    "synthesis": "mu synthesis",
    "campaign": "to run the worst again: fingergait run",
    "read_log": "walked for",
}


def test_each_example_is_known() -> None:
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(PRINTS)


@pytest.mark.parametrize("name", PRINTS)
def test_example(name: str, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(EXAMPLES / f"{name}.py")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert PRINTS[name] in done.stdout


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::RuntimeWarning")  # the kernel's own
def test_notebook(tmp_path: Path) -> None:
    notebook = nbformat.read(EXAMPLES / "turn.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)  # what is committed is what was written
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pages = [output["data"]["text/html"] for output in shown if "text/html" in output.get("data", {})]
    run = max(pages, key=len)
    assert run.count("data:image/png;base64,") >= 3 and "<caption>lift-and-rotate" in run
    assert any("Run lift-and-rotate" in output.get("text", "") for output in shown)
