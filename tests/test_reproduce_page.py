"""The page of a reproduction: complete, self-contained, and sound in a real browser."""

import html
import json
import os
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from fingergait.reproduce.ablations import CONDITIONS, VARIANTS, Cell
from fingergait.reproduce.experiments.quality import quality
from fingergait.reproduce.experiments.step import step
from fingergait.reproduce.limits import Bisection, Trial, all_limits
from fingergait.reproduce.page import figure, limit_row, write_page
from fingergait.reproduce.pool import run_case
from fingergait.reproduce.result import Reproduction
from fingergait.reproduce.run import as_json

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_PROBE = """<script>addEventListener("load", () => {
  const images = [...document.images].map(image => image.complete ? image.naturalWidth : 0);
  const boxes = [...document.querySelectorAll("article, table, figure, code")]
    .map(element => element.getBoundingClientRect().right);
  const visible = document.querySelector("h1").getBoundingClientRect().height > 0;
  document.title = JSON.stringify({images, visible, right: Math.max(...boxes),
    width: document.documentElement.clientWidth, scroll: document.documentElement.scrollWidth});
});</script></body>"""


@pytest.fixture(scope="module")
def result() -> Reproduction:
    experiments = [step(), quality()]
    cases = [case for experiment in experiments for case in experiment.cases]
    outcomes = {case.key: run_case(case) for case in cases}
    found = {}
    for limit in all_limits():
        middle = 0.5 * (limit.easy + limit.hard)
        trials = (
            Trial(limit.easy, True, "", "", "fingergait run a"),
            Trial(limit.hard, False, "joint torques reached their limit at 3.0 s", "lost", "fingergait run <b>"),
            Trial(middle, True, "", "", "fingergait run c"),
        )
        found[limit.key] = [Bisection(limit.key, seed, trials, middle, limit.hard) for seed in range(2)]
    cell = Cell(1, 2, 0.01, 1e-4, 5e-3, 0.9, 0.2, 1.0, "fingergait run d")
    return Reproduction(
        quick=True,
        seconds=12.3,
        experiments=experiments,
        claims={e.key: e.judge({case.key: outcomes[case.key] for case in e.cases}) for e in experiments},
        outcomes=outcomes,
        limits=all_limits(),
        bisections=found,
        ablations={variant: dict.fromkeys(CONDITIONS, cell) for variant in VARIANTS},
    )


@pytest.fixture(scope="module")
def page(result: Reproduction, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "index.html"
    write_page(result, path)
    return path


class Links(HTMLParser):
    """Collects what a page refers to and the names it defines."""

    def __init__(self) -> None:
        super().__init__()
        self.references: list[str] = []
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src", "srcset", "data", "action") and value:
                self.references.append(value)
            if name == "id" and value:
                self.names.add(value)


def test_the_page_needs_no_other_file(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    links = Links()
    links.feed(text)
    assert links.references
    for reference in links.references:
        assert reference.startswith("data:image/") or reference.removeprefix("#") in links.names, reference[:80]
    style = re.sub(r"data:image/[^\"]*", "", text)
    assert not re.search(r"https?://|@import|url\(|<script|<link|<iframe", style)


def test_every_claim_stands_with_its_figures_verdict_and_command(page: Path, result: Reproduction) -> None:
    text = html.unescape(page.read_text(encoding="utf-8"))
    assert len(result.all_claims) == 10
    for claim in result.all_claims:
        card = text.split(f'id="claim-{claim.name}"')[1].split("</article>")[0]
        for word in (claim.claim, claim.command, claim.paper or "–", figure(claim.measured), figure(claim.limit)):
            assert word in card
        assert ("held" if claim.held else "missed") in card
    for caption in ("Tracking errors after the step", "Relocations in the middle of the run"):
        assert caption in text
    for limit in result.limits:
        assert limit.title in text
    for variant in VARIANTS:
        assert f"<td>{variant}</td>" in text
    assert "<b>" not in text.split("fingergait run <b>")[0][-20:]  # a command is text and never markup
    for value in result.outcomes[next(iter(result.outcomes))].metrics["versions"].values():
        assert value in text


def test_the_json_has_the_promised_names(result: Reproduction, page: Path) -> None:
    summary: dict[str, Any] = json.loads(json.dumps(as_json(result, page), allow_nan=False))
    assert summary["report"] == str(page)
    for claim in summary["claims"]:
        assert {"name", "claim", "measured", "limit", "held", "scenario", "command"} <= claim.keys()
    assert summary["held"] == sum(claim["held"] for claim in summary["claims"])
    assert {"versions", "simulator", "machine", "controller", "limits", "ablations"} <= summary.keys()


def test_a_limit_is_told_by_its_worst_seed() -> None:
    limit = next(limit for limit in all_limits() if limit.key == "yaw_rate")

    def search(seed: int, held: float | None, lost: float | None) -> Bisection:
        trials = () if lost is None else (Trial(lost, False, f"seed {seed}", "end", f"command {seed}"),)
        return Bisection(limit.key, seed, trials, held, lost)

    row = limit_row(limit, [search(0, 0.4, 0.5), search(1, 0.3, 0.35)])
    assert (row.held, row.lost, row.reason, row.command) == ("0.3 rad/s", "0.35 rad/s", "seed 1", "command 1")
    assert limit_row(limit, [search(0, 1.2, None)]).lost == "beyond 1.2 rad/s"
    assert limit_row(limit, [search(0, 0.3, 0.4), search(1, None, 0.2)]).held == "none"


def _browser() -> str:
    for name in _BROWSERS:
        path = shutil.which(name)
        if path is not None:
            return path
    pytest.skip("expected a headless browser to look at the page, found none; install it: apt-get install chromium")


@pytest.mark.parametrize("width", [1280, 500])
def test_a_browser_shows_the_page_whole_and_offline(page: Path, tmp_path: Path, width: int) -> None:
    browser = _browser()
    probed = tmp_path / "probed.html"
    probed.write_text(page.read_text(encoding="utf-8").replace("</body>", _PROBE), encoding="utf-8")
    command = [
        browser,
        "--headless",
        "--disable-gpu",
        "--no-first-run",
        "--disable-dev-shm-usage",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--user-data-dir={tmp_path / 'profile'}",
        f"--window-size={width},900",
        "--virtual-time-budget=20000",
        "--dump-dom",
        probed.as_uri(),
    ]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        command.insert(1, "--no-sandbox")  # a browser refuses to run as root otherwise
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    title = re.search(r"<title>(.*?)</title>", done.stdout)
    assert title is not None
    seen = json.loads(html.unescape(title.group(1)))
    assert seen["visible"]
    assert len(seen["images"]) >= 4  # steps, relocations, limits, and a film strip where a GL library is there
    assert min(seen["images"]) > 0
    assert seen["scroll"] <= seen["width"]
    assert seen["right"] <= seen["width"] + 1.0
