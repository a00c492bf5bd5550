"""The work of `fingergait campaign`: sample, run, keep, judge, report."""

import contextlib
import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from distributed import Client

from fingergait._core import ConfigError, DualStagePlanner, HandModel
from fingergait.campaign.build import build_id
from fingergait.campaign.causes import cause, status
from fingergait.campaign.cluster import connect, default_workers, run_all
from fingergait.campaign.progress import CampaignProgress
from fingergait.campaign.replay import replay
from fingergait.campaign.report import write_campaign_page
from fingergait.campaign.sampling import Sample, Sampler
from fingergait.campaign.spec import CampaignSpec
from fingergait.campaign.statistics import summary
from fingergait.campaign.store import Store, row_schema
from fingergait.campaign.trial import Outcome, Trial
from fingergait.files import write_text
from fingergait.hand import hand_json
from fingergait.paths import find
from fingergait.run.simulate import load_controller, versions
from fingergait.sim.plant import MujocoPlant
from fingergait.stopping import Stopped

_CHECKED = 64  # samples whose values are checked before anything runs


@dataclass(frozen=True)
class Options:
    """How a campaign is run, none of which changes its rows."""

    workers: int | None = None
    scheduler: str | None = None
    resume: bool = False
    out: Path | None = None


def run_campaign(spec: CampaignSpec, options: Options) -> dict[str, Any]:
    """Runs a campaign, or what is left of it, and writes its data set and report; the figures of `--json`.

    Raises
    ------
    ConfigError
        Where the spec, the scheduler or the folder is not as it must be; nothing has run then.
    """
    sampler = Sampler(spec)
    first = list(islice(sampler, _CHECKED))
    _try_out(sampler, first[0] if first else None)
    total = spec.samples if spec.method != "grid" else sum(1 for _ in sampler)
    folder = options.out if options.out is not None else Path("runs") / f"campaign-{spec.name}"
    with contextlib.ExitStack() as stack:
        # A scheduler that isn't there must not cost the folder.
        client = None if options.scheduler is None else stack.enter_context(connect(options.scheduler, None))
        store = Store(folder, _manifest(spec, sampler), row_schema(sampler.columns), options.resume)
        done = store.done()
        seen = Counter(store.rows().column("status").to_pylist())
        begin = time.perf_counter()
        if len(done) < total:
            try:
                if client is None:
                    client = stack.enter_context(connect(None, options.workers))
                _run(spec, sampler, store, client, done, CampaignProgress(spec.name, total, seen))
            except Stopped as stop:
                kept = f"{len(store.done())} of {total} runs are kept; --resume --out {folder} goes on"
                raise Stopped(kept, stop.status - 128) from None
        else:
            for _ in sampler:  # counts the points passed over
                pass
    seconds = time.perf_counter() - begin
    rows = store.finish()
    figures = {"campaign": spec.name, **summary(rows, spec.limits), "skipped": sampler.skipped}
    figures["speed"] = _speed(rows.num_rows - len(done), seconds, options)
    figures["versions"] = versions()
    figures["data"], figures["report"] = str(folder / "data"), str(folder / "report.html")
    write_campaign_page(spec, rows, store.timings(), figures, folder / "report.html")
    write_text(folder / "summary.json", json.dumps(figures, indent=2) + "\n")
    return figures


def _run(
    spec: CampaignSpec, sampler: Sampler, store: Store, client: Client, done: set[int], progress: CampaignProgress
) -> None:
    pending: dict[int, Sample] = {}
    base = sampler.base.model_dump(mode="json", exclude_unset=True)
    build, numeric = build_id(), sampler.columns

    def trials() -> Iterator[Trial]:
        for sample in sampler:
            if sample.index not in done:
                pending[sample.index] = sample
                yield Trial(sample.index, base, sample.overrides, build)

    def keep(outcomes: list[Outcome]) -> None:
        rows = [_row(spec, numeric, pending.pop(outcome.index), outcome) for outcome in outcomes]
        store.add(rows, [{"index": outcome.index, **outcome.timing} for outcome in outcomes])
        progress.add([row["status"] for row in rows])

    with progress:
        run_all(client, trials(), keep)


def _row(spec: CampaignSpec, numeric: dict[str, bool], sample: Sample, outcome: Outcome) -> dict[str, Any]:
    label, promise = sample.fault if sample.fault is not None else (None, None)
    return {
        "index": sample.index,
        "seed": sample.overrides["seed"],
        "fault": label,
        "promise": promise,
        **{f"x.{name}": value if numeric[name] else _text(value) for name, value in sample.drawn.items()},
        "status": status(outcome.row),
        "cause": cause(outcome.row, label),
        **outcome.row,
        "replay": replay(spec, sample.overrides),
    }


def _text(value: Any) -> str:
    """A drawn value that is no number as text: a text as it is, the rest as JSON."""
    return value if isinstance(value, str) else json.dumps(value)


def _try_out(sampler: Sampler, sample: Sample | None) -> None:
    """Builds plant and controller of one sample, so that what they refuse is said before anything runs."""
    if sample is None:
        raise ConfigError("vary: expected at least one object that can exist, found none")
    scenario = sampler.base.replace(sample.overrides)
    plant = MujocoPlant(scenario)
    hand = HandModel(hand_json(find(scenario.hand.file, "", ".xml", "hand.file")))
    DualStagePlanner(hand, load_controller(scenario), plant.config)


def _manifest(spec: CampaignSpec, sampler: Sampler) -> dict[str, Any]:
    """What a campaign is: where it differs, rows must not be mixed."""
    scenario = sampler.base.model_dump(mode="json", exclude_unset=True)
    described = spec.model_dump(mode="json", exclude={"samples"})  # more samples may be added
    return {"spec": described, "scenario": scenario, "build": build_id(), "versions": versions()}


def _speed(runs: int, seconds: float, options: Options) -> dict[str, Any]:
    """How fast this command went: runs, wall-clock time, s, and workers where it started them itself."""
    workers = None if options.scheduler is not None else options.workers or default_workers()
    return {"runs": runs, "seconds": seconds, "workers": workers}
