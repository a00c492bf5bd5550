"""The command `fingergait`. Each command's work is elsewhere; here are its options, its output and its exit status."""

import io
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from fingergait._core import ConfigError, FingergaitError
from fingergait.catalogue import KINDS, catalogue, names
from fingergait.files import make_folder, why
from fingergait.scenario import Scenario, parse_override
from fingergait.stopping import Stopped, stoppable

if TYPE_CHECKING:
    from fingergait.run.command import Viewer

DONE, MISSED, BAD_INPUT = 0, 1, 2

app = typer.Typer(pretty_exceptions_enable=False, rich_markup_mode="rich")

WELCOME = """\
Turn an object in a robot hand without end. Try first:

  fingergait run lift-and-rotate --duration 10    lift a cylinder and turn it: table, plots, film strip, log
  fingergait play                                 the same live in the browser, to drag, push and break
  fingergait list                                 what else is packaged
  fingergait check my-hand.xml                    will my hand do?
  fingergait --help                               every command

Names complete in the shell after: fingergait --install-completion
"""


def names_of(kind: str) -> Callable[[str], list[str]]:
    """What the shell offers for a packaged file's name."""
    return lambda incomplete: [name for name in names(kind) if name.startswith(incomplete)]


def example(*lines: str) -> str:
    """The end of a command's help."""
    return "Example" + ("s" if len(lines) > 1 else "") + ":\n\n" + "\n\n".join(lines)


@app.callback(invoke_without_command=True)
def start(context: typer.Context) -> None:
    """Turn an object in a robot hand without end: simulate, synthesise, reproduce, measure."""
    if context.invoked_subcommand is None:
        typer.echo(WELCOME)


Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Replace a scenario key.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]

Port = Annotated[int, typer.Option(min=1, max=65535, help="Where the page listens; else the next free port.")]
Host = Annotated[str, typer.Option(metavar="ADDRESS", help="Address to listen on; others than this machine see it.")]


@app.command(epilog=example("fingergait run push --seed 3 --set truth.mass_scale=1.4"))
def run(
    scenario: Annotated[
        str, typer.Argument(help="A packaged scenario's name, or a TOML file.", autocompletion=names_of("scenarios"))
    ],
    set_: Overrides = None,
    duration: Annotated[float | None, typer.Option(help="Simulated time, s.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the sensor noise.")] = None,
    no_gait: Annotated[bool, typer.Option("--no-gait", help="Never relocate a finger.")] = False,
    controller: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Controller artefact, or its name.", autocompletion=names_of("controllers")),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Where the results go.")] = None,
    as_json: Json = False,
    view: Annotated[
        str | None, typer.Option("--view", metavar="[=native]", help="Show it live, in the browser or MuJoCo's window.")
    ] = None,
    video: Annotated[Path | None, typer.Option(metavar="FILE.mp4", help="Write a video.")] = None,
) -> None:
    """Run a scenario; write its log, plots and film strip."""
    from fingergait.run.command import run_scenario

    overrides = dict(map(parse_override, set_ or []))
    given = {"duration": duration, "seed": seed, "controller.file": controller}
    overrides |= {key: value for key, value in given.items() if value is not None}
    if no_gait:
        overrides["gait.enabled"] = False
    loaded = Scenario.load(scenario, overrides)
    metrics, stopped = run_scenario(loaded, out, _viewer(view), video, quiet=as_json)
    if as_json:
        print_json(metrics)
    if stopped is not None:
        raise stopped
    raise typer.Exit(DONE if metrics["completed"] else MISSED)


@app.command(epilog=example("fingergait play", "fingergait play hold-four-by-four --port 9000"))
def play(
    scenario: Annotated[
        str, typer.Argument(help="A packaged scenario's name, or a TOML file.", autocompletion=names_of("scenarios"))
    ] = "lift-and-rotate",
    set_: Overrides = None,
    port: Port = 8080,
    host: Host = "127.0.0.1",
) -> None:
    """Play with a scenario in the browser: drag the object, push it, cut a finger's power, and see why."""
    from fingergait.view.play import play as serve

    serve(Scenario.load(scenario, dict(map(parse_override, set_ or []))), host, port)


@app.command(epilog=example("fingergait show runs/lift-and-rotate-0/log.parquet"))
def show(
    log: Annotated[Path, typer.Argument(metavar="LOG.parquet", help="The log of a run.")],
    port: Port = 8080,
    host: Host = "127.0.0.1",
    rerun: Annotated[Path | None, typer.Option(metavar="FILE.rrd", help="Write it for rerun, show nothing.")] = None,
) -> None:
    """Show a recorded run in the browser, with a time bar."""
    if rerun is not None:
        from fingergait.view.rerun import export

        typer.echo(f"{rerun}: {export(log, rerun)} pictures")
    else:
        from fingergait.view.show import show as serve

        serve(log, host, port)


@app.command(epilog=example("fingergait suite --seeds 4 --set duration=10"))
def suite(
    seeds: Annotated[int, typer.Option(min=1, help="How many seeds.")] = 30,
    first: Annotated[int, typer.Option(min=0, help="The first seed.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    scenario: Annotated[
        str, typer.Option(help="The scenario that is varied.", autocompletion=names_of("scenarios"))
    ] = "lift-and-rotate",
    set_: Overrides = None,
    as_json: Json = False,
) -> None:
    """Run the sampled suite: every seed draws object, grasp, errors of the model and noise at once."""
    from fingergait.run.report.suite_table import SuiteTable
    from fingergait.run.suite import run_suite

    table = SuiteTable(seeds, Console(stderr=True) if as_json else Console())
    rows: list[dict[str, Any]] = []

    def add(row: dict[str, Any]) -> None:
        rows.append(row)
        table.add(row)

    stopped: Stopped | None = None
    try:
        with table:
            rows = run_suite(list(range(first, first + seeds)), workers, scenario, set_ or [], add)
    except Stopped as stop:
        stopped = Stopped(f"{len(rows)} of {seeds} seeds are done: the rows above", stop.status - 128)
    summary = table.summary(rows)
    if as_json:
        print_json({**summary, "runs": rows})
    if stopped is not None:
        raise stopped
    raise typer.Exit(DONE if summary["held"] == len(rows) else MISSED)


@app.command(epilog=example("fingergait campaign paper-box --samples 100 --out runs/box"))
def campaign(
    spec: Annotated[
        str,
        typer.Argument(
            metavar="SPEC.toml",
            help="A packaged campaign's name, or a TOML file.",
            autocompletion=names_of("campaigns"),
        ),
    ],
    samples: Annotated[int | None, typer.Option(min=1, help="Number of runs, instead of the campaign's own.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Local processes; all cores by default.")] = None,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A dask scheduler to use instead.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted campaign.")] = False,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Where the data set and the report go.")] = None,
    as_json: Json = False,
) -> None:
    """Run a campaign of sampled scenarios; write its data set and report."""
    from fingergait.campaign.command import Options, run_campaign
    from fingergait.campaign.spec import CampaignSpec
    from fingergait.campaign.table import show

    figures = run_campaign(CampaignSpec.load(spec, samples), Options(workers, scheduler, resume, out))
    if as_json:
        print_json(figures)
    else:
        show(figures, Console())
    raise typer.Exit(DONE if all(claim["held"] for claim in figures["claims"]) else MISSED)


@app.command(epilog=example("fingergait reproduce --quick"))
def reproduce(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the page and the JSON file go.")] = Path(
        "runs/reproduce"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer seeds and shorter runs: some minutes.")] = False,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    as_json: Json = False,
) -> None:
    """Run the paper's experiments and past them; write a page with each claim beside what was measured."""
    from fingergait.reproduce.run import reproduce as run_all
    from fingergait.reproduce.table import show_claims

    summary = run_all(out, quick, workers)
    if as_json:
        print_json(summary)
    else:
        show_claims(summary, Console())
    raise typer.Exit(DONE if summary["held"] == len(summary["claims"]) else MISSED)


@app.command("synthesize", epilog=example("fingergait synthesize contact --out runs/mine.json"))
def synthesize(
    spec: Annotated[
        str,
        typer.Argument(
            metavar="SPEC.toml", help="A packaged spec's name, or a TOML file.", autocompletion=names_of("specs")
        ),
    ] = "contact",
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where the artefact goes; the report beside it.")] = Path(
        "runs/controller.json"
    ),
    rate: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Control rate instead of the spec's; its delay keeps its samples."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Synthesise a robust controller; write its artefact and a one-page report with its certificate."""
    from fingergait.paths import find
    from fingergait.synthesis.command import run_synthesize

    make_folder(out.parent)
    run_synthesize(find(spec, "specs", ".toml", "SPEC"), out, as_json, rate=rate)


@app.command(epilog=example("fingergait adopt my-hand.xml --facts my-hand.facts.toml --out my-hand"))
def adopt(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="An MJCF or URDF file, or a packaged hand's name.",
            autocompletion=names_of("hands"),
        ),
    ],
    facts: Annotated[Path | None, typer.Option(metavar="FILE.toml", help="Facts of the hand.")] = None,
    objects: Annotated[
        list[str] | None, typer.Option("--objects", metavar="FAMILY", help="cylinder, ball or box; all by default.")
    ] = None,
    mass: Annotated[
        float | None, typer.Option(help="Of the objects, kg; by default what the hand should carry.")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="The bundle; runs/adopt-<model> by default.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer objects and runs, no synthesis.")] = False,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; all cores by default.")] = None,
    as_json: Json = False,
) -> None:
    """Adopt a hand: grasps, controller, scenarios and a report of what it does; stages that stand are not repeated."""
    from fingergait.adopt import Adoption
    from fingergait.adopt.command import run_adopt, show_adoption
    from fingergait.adopt.family import FAMILIES

    chosen = tuple(objects or FAMILIES)
    values = run_adopt(Adoption(model, facts, out, objects=chosen, mass=mass, quick=quick, workers=workers))
    if as_json:
        print_json(values)
    else:
        show_adoption(values, Console())
    raise typer.Exit(DONE if values["turns"] else MISSED)


@app.command(epilog=example("fingergait grasps my-hand.xml --facts my-hand.facts.toml --object ball"))
def grasps(
    hand: Annotated[
        str,
        typer.Argument(
            metavar="HAND.xml",
            help="A packaged hand's name, or an MJCF or URDF file.",
            autocompletion=names_of("hands"),
        ),
    ] = "hand",
    facts: Annotated[Path | None, typer.Option(metavar="FILE.toml", help="Facts of the hand.")] = None,
    family: Annotated[
        list[str] | None, typer.Option("--object", metavar="FAMILY", help="cylinder, ball or box; all by default.")
    ] = None,
    mass: Annotated[
        float | None, typer.Option(help="Of the objects, kg; by default what the hand should carry.")
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where grasps.json and map.png go.")] = Path("runs/grasps"),
    quick: Annotated[bool, typer.Option("--quick", help="Less effort: shorter strokes may be found.")] = False,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; all cores by default.")] = None,
    as_json: Json = False,
) -> None:
    """Search the grasps from which a hand can turn objects; say what forbids the others."""
    from fingergait.adopt.command import run_grasps, show
    from fingergait.adopt.family import FAMILIES

    values = run_grasps(hand, facts, tuple(family or FAMILIES), mass, out, quick, workers)
    if as_json:
        print_json(values)
    else:
        show(values, Console())
    raise typer.Exit(DONE if any(entry["kind"] == "gait" for entry in values["objects"]) else MISSED)


@app.command(epilog=example("fingergait bench --quick"))
def bench(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the rows and the plot go.")] = Path("runs/bench"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer steps and problems.")] = False,
    as_json: Json = False,
) -> None:
    """Time the control step and its solvers, beside other solvers where they are installed."""
    from fingergait.bench.run import run_bench

    result = run_bench(out, quick, Console(stderr=True) if as_json else Console())
    if as_json:
        print_json(result)


@app.command(epilog=example("fingergait check my-hand.xml"))
def check(
    file: Annotated[
        Path, typer.Argument(help="A scenario (.toml), a controller artefact (.json) or a hand (.xml, .urdf).")
    ],
    facts: Annotated[Path | None, typer.Option(metavar="FILE.toml", help="Facts of the hand.")] = None,
    as_json: Json = False,
) -> None:
    """Say whether a file is valid, and what is in it."""
    from fingergait.check import check_file

    found = check_file(file, facts)
    text = found.pop("text")
    if as_json:
        print_json(found)
    else:
        typer.echo("\n".join(text), err=not found["valid"])
    raise typer.Exit(DONE if found["valid"] else BAD_INPUT)


@app.command("list", epilog=example("fingergait list scenarios", "fingergait list --json"))
def list_packaged(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="[" + "|".join(KINDS) + "]",
            help="Only this kind.",
            autocompletion=lambda incomplete: [kind for kind in KINDS if kind.startswith(incomplete)],
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the packaged scenarios, hands, controllers, specs and campaigns, with a line each."""
    found = catalogue(kind)
    if as_json:
        print_json(found)
        return
    for key, entries in found.items():
        typer.echo(f"{key}:")
        width = max(map(len, entries), default=0)
        for name, line in entries.items():
            typer.echo(f"  {name:{width}}  {line}")


def _viewer(kind: str | None) -> "Viewer | None":
    from fingergait.run.command import NativeViewer

    if kind is None:
        return None
    if kind == "native":
        return NativeViewer
    if kind == "page":
        from fingergait.view import server
        from fingergait.view.live import LivePage

        server.require()
        return LivePage
    raise ConfigError(f"--view: expected nothing, or --view=native, found {kind!r}")


def print_json(value: object) -> None:
    """Writes one JSON object to standard output."""
    print(json.dumps(value, indent=2, allow_nan=False))


def spelled_out(arguments: list[str]) -> list[str]:
    """The arguments with the value of `--view`, which may be left out: Typer has no such options."""
    return ["--view=page" if argument == "--view" else argument for argument in arguments]


def main() -> None:
    """Entry point: errors made on purpose and the system's are one line on standard error and exit status 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal without some character shows its number
            stream.reconfigure(errors="backslashreplace")
    try:
        with stoppable():
            app(spelled_out(sys.argv[1:]))
    except FingergaitError as error:
        _complain(f"{error}")
        sys.exit(BAD_INPUT)
    except Stopped as stop:
        _complain(f"stopped: {stop}")
        sys.exit(stop.status)
    except OSError as error:
        name = f"{os.fsdecode(error.filename)}: " if isinstance(error.filename, str | bytes) else ""
        _complain(f"{name}{why(error)}")
        sys.exit(BAD_INPUT)


def _complain(message: str) -> None:
    print(f"fingergait: {' '.join(message.split())}", file=sys.stderr)


if __name__ == "__main__":
    main()
