"""`wallkit evaluate`, `compare` and `report`: what runs are worth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wallkit.cli import common, read_batch

if TYPE_CHECKING:
    from wallkit.pipelines.evaluate import EvaluateSettings, Evaluation
    from wallkit.pipelines.run_folder import RunRecord

RUNS = click.argument("runs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RUN...")
truth_option = click.option(
    "--truth", type=click.Path(path_type=Path), metavar="FILE.tum", help="True poses; else the run's own truth."
)


@click.command()
@RUNS
@truth_option
@click.option("--t-offset", type=common.Number(), metavar="S", help="Added to the stamps of the truth.")
@click.option("--max-ate-m", type=common.Number(), metavar="M", help="Exit 1 if the rmse of any run is above.")
@click.option("--evo", is_flag=True, help="Also write result zips for evo_res into --out.")
@common.out_option
@common.overwrite_option
@common.config_option
@common.set_option
@common.json_option
@click.pass_context
def evaluate(ctx: click.Context, /, runs: tuple[Path, ...], as_json: bool, **flags: Any) -> None:
    """Say how wrong runs were, how fast they converged, and whether they knew.

    RUN is a result folder of wallkit localize; a folder of several seeds counts as all of them, and gets mean, sd and worst.

    Exits 0, or 1 if a run is worse than --max-ate-m.

    \b
    Examples:
      wallkit evaluate log.wallkit
      wallkit evaluate log.wallkit --truth mocap.tum --max-ate-m 0.1
      wallkit evaluate log.wallkit --json | jq .metrics.ate_rmse_m
      wallkit evaluate a/ b/ --evo --out zips
    """
    _check_evo(flags["out"], is_evo=flags["evo"], overwrite=flags["overwrite"])
    settings = _settings(flags["config_path"], flags["words"], flags["t_offset"])
    found = [pair for run in runs for pair in load_seeds(run, settings, flags["truth"])]
    if as_json:
        common.emit(_document(found))
    else:
        click.echo(_table(found))
    if flags["evo"]:
        _write_evo(flags["out"], runs, found, overwrite=flags["overwrite"])
    limit = flags["max_ate_m"]
    if limit is not None:
        worst = max(_ate_of(record, evaluation) for record, evaluation in found)
        if not worst <= limit:
            click.echo(f"error {worst:.4f} m is above {limit:g} m", err=True)
            ctx.exit(common.FAILED_CHECK)


@click.command()
@RUNS
@truth_option
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), metavar="FILE.html", help="Write the comparison as a page."
)
@click.option("--paper", is_flag=True, help="A row for each: time, CPU, mean error, updates to converge, sd, memory.")
@read_batch.batch_options
@common.config_option
@common.set_option
@common.seed_option
@common.json_option
def compare(
    runs: tuple[Path, ...], truth: Path | None, out: Path | None, paper: bool, as_json: bool, **flags: Any
) -> None:
    """Put several runs side by side, with tests of significance against the first.

    RUN is a result folder, of one seed or several, or a folder of such folders: one configuration over several logs. A
    folder of configurations stands for all of them, and so does that of wallkit batch.

    Over several logs all intervals and tests are over logs, since runs of one log are alike.

    \b
    Examples:
      wallkit compare basic.wallkit filtered.wallkit
      wallkit compare a/ b/ c/ -o compare.html
      wallkit compare --paper basic/ wall_mask/ soft_mask/
      wallkit compare basic/ wall_mask/ --by people --names "{scene}-{people}-{take}"
      wallkit compare batch/ --baseline basic --metric lost_share
    """
    from dataclasses import asdict

    if read_batch.is_for(runs, {**flags, "paper": paper}):
        read_batch.compare(runs, _names(runs), {**flags, "truth": truth}, out=out, is_paper=paper, as_json=as_json)
        return
    from wallkit.pipelines.report import COMPARED, COMPARED_IN_PAPERS, compare_runs, write_compare_report
    from wallkit.report.compare import compare_rows, difference_rows
    from wallkit.report.paper import paper_differences, paper_headers, paper_rows

    settings = _settings(flags["config_path"], flags["words"], None)
    names = _names(runs)
    loaded, keys = [load_seeds(run, settings, truth) for run in runs], COMPARED_IN_PAPERS if paper else COMPARED
    data = compare_runs(loaded, names, settings, seed=flags["seed"], keys=keys)
    if as_json:
        numbers = {c.name: {k: v.value for k, v in c.metrics.items()} for c in data.contenders}
        spreads = {c.name: {k: asdict(v) for k, v in c.spreads.items()} for c in data.contenders}
        differences = [{"a": a, "b": b, **asdict(d)} for a, b, d in data.differences]
        common.emit({"runs": numbers, "spreads": spreads, "differences": differences, "notes": data.notes})
    elif paper:
        headers = paper_headers()
        click.echo(common.table(headers, paper_rows(data), right=tuple(range(1, len(headers)))))
        for line in (*paper_differences(data), *(f"note: {note}" for note in data.notes)):
            click.echo(line)
    else:
        rows = [[row.key, *(f"{c.text}{' *' if c.is_best else ''}" for c in row.cells)] for row in compare_rows(data)]
        click.echo(common.table(["metric (* best)", *names], rows, right=tuple(range(1, len(names) + 1))))
        for key, what, how_sure in difference_rows(data):
            click.echo(f"{key}: {what} [{how_sure}]")
        for note in data.notes:
            click.echo(f"note: {note}")
        click.echo(data.verdict)
    if out is not None:
        write_compare_report(out, data)
        click.echo(f"report   {out}", err=as_json)


@click.command()
@RUNS
@truth_option
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), metavar="FILE.html", help="Default: report.html in the run."
)
@click.option(
    "--animate",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Its particles as a .gif, a .mp4 (extra [video]) or six moments as a .png, and no page.",
)
@read_batch.batch_options
@common.config_option
@common.set_option
@common.seed_option
@common.quiet_option
def report(runs: tuple[Path, ...], truth: Path | None, out: Path | None, animate: Path | None, **flags: Any) -> None:
    """Draw the page of a run again, or one page of several, or of many logs, or how its particles gather.

    The folder of a batch, or folders of result folders, one for each configuration, make the page of many logs: what
    differs, the worst runs, and where on the map they fail.

    \b
    Examples:
      wallkit report log.wallkit --truth mocap.tum -o with-truth.html
      wallkit report a/ b/ --out report.html
      wallkit report basic/ wall_mask/ --names "{scene}-{people}-{take}" --by people -o report.html
      wallkit report log.wallkit --animate cloud.mp4
      wallkit report log.wallkit --animate cloud.png
    """
    from wallkit.pipelines.report import compare_runs, write_compare_report, write_run_report

    settings = _settings(flags["config_path"], flags["words"], None)
    if animate is None and read_batch.is_for(runs, {**flags, "paper": True}):
        read_batch.report(runs, _names(runs), {**flags, "truth": truth}, out=out, settings=settings)
        return
    if animate is not None:
        from wallkit.pipelines.animate import write_animation

        if len(runs) > 1 or out is not None:
            raise click.UsageError("--animate draws one run, and nothing else")
        moments = write_animation(animate, load_seeds(runs[0], settings, truth)[0][0], runs[0])
        click.echo(f"animated {animate}: {moments} moments")
        return
    if len(runs) == 1:
        record, evaluation = load_seeds(runs[0], settings, truth)[0]
        out = out or runs[0] / "report.html"
        write_run_report(out, record, evaluation, settings)
    else:
        if out is None:
            raise click.UsageError("several runs make a page of their own: say where with --out report.html")
        loaded = [load_seeds(run, settings, truth) for run in runs]
        write_compare_report(out, compare_runs(loaded, _names(runs), settings, seed=flags["seed"]))
    click.echo(f"report   {out}")


def load_seeds(folder: Path, settings: EvaluateSettings, truth: Path | None) -> list[tuple[RunRecord, Evaluation]]:
    """The runs in a result folder, judged: one, or one per seed; of a folder of result folders all of theirs, by name."""
    from dataclasses import replace

    from wallkit.evaluate.tum import read_tum
    from wallkit.pipelines.evaluate import evaluate_steps
    from wallkit.pipelines.run_folder import read_run

    known = None if truth is None else read_tum(truth)
    found = []
    for one in _folders_in(folder):
        record = read_run(one)
        record = record if known is None else replace(record, truth=known)
        found.append((record, evaluate_steps(record.steps, record.truth, settings)))
    return found


def _folders_in(folder: Path) -> list[Path]:
    """The folders of the single runs that `load_seeds` reads, in the same order."""
    from wallkit.pipelines.run_folder import results_in, seed_folders

    if not (folder / "run.json").is_file() and (inside := results_in(folder)):
        return [one for result in inside for one in _folders_in(result)]
    return seed_folders(folder) or [folder]


def _settings(config_path: Path | None, words: tuple[str, ...], offset_s: float | None) -> EvaluateSettings:
    from wallkit.pipelines.config import load_config

    flags = {"evaluate.truth_offset_s": (offset_s, "--t-offset")}
    return load_config(config_path, words, flags).config.evaluate


def _document(found: list[tuple[RunRecord, Evaluation]]) -> dict[str, Any]:
    from wallkit.pipelines.seeds import summary_document

    if len(found) > 1:
        return summary_document(found)
    record, evaluation = found[0]
    numbers = {**evaluation.metrics, **record.resources}
    metrics = {key: value.value for key, value in numbers.items()}
    return {"health": record.answer["health"], "seed": record.run["seed"], "metrics": metrics}


def _table(found: list[tuple[RunRecord, Evaluation]]) -> str:
    from wallkit.evaluate.statistics import summarise
    from wallkit.report.wording import spread_text, value_text

    if len(found) == 1:
        record, evaluation = found[0]
        values = {**evaluation.metrics, **record.resources}.values()
        return common.table(
            ["metric", "value", "definition"], [[v.key, value_text(v), v.definition] for v in values], right=(1,)
        )
    spreads = summarise([{**evaluation.metrics, **record.resources} for record, evaluation in found])
    rows = [[key, spread_text(spread)] for key, spread in spreads.items()]
    return common.table(["metric", f"over {len(found)} runs"], rows)


def _ate_of(record: RunRecord, evaluation: Evaluation) -> float:
    from wallkit.errors import WallkitError

    value = evaluation.metrics.get("ate_rmse_m")
    if value is None or value.value is None:
        raise WallkitError("has no truth to hold against --max-ate-m", where=record.name, hint="--truth FILE.tum")
    return value.value


def _check_evo(out: Path | None, *, is_evo: bool, overwrite: bool) -> None:
    """Refuse, before anything is read, zips without a place and a place without zips."""
    from wallkit.pipelines.outputs import check_out

    if not is_evo and (out is not None or overwrite):
        raise click.UsageError("--out and --overwrite are for the zips of --evo")
    if is_evo and out is None:
        raise click.UsageError("say where the zips go: --out FOLDER")
    if out is not None:
        check_out(out, overwrite=overwrite)


def _write_evo(
    out: Path, runs: tuple[Path, ...], found: list[tuple[RunRecord, Evaluation]], *, overwrite: bool
) -> None:
    """A zip for each run and kind of error, and a run.json, by which --overwrite knows the folder again."""
    from wallkit.errors import WallkitError
    from wallkit.evaluate.evo import write_evo_zip
    from wallkit.evaluate.metrics import SERIES
    from wallkit.pipelines.outputs import result_folder
    from wallkit.pipelines.run_folder import write_json

    names = _zip_names(runs)
    with result_folder(out, overwrite=overwrite) as folder:
        for of_run, (record, evaluation) in zip(names, found, strict=True):
            if evaluation.pairs is None:
                raise WallkitError(
                    "has no truth, so there is no error to export", where=record.name, hint="--truth FILE.tum"
                )
            for series in SERIES:
                if SERIES[series](evaluation.pairs) is not None:
                    write_evo_zip(folder / f"{series}{of_run}.zip", evaluation.pairs, series)
        write_json(folder / "run.json", {"schema": 1, "command": "evaluate --evo", "runs": [str(run) for run in runs]})
    click.echo(f"evo      {out}", err=True)


def _zip_names(runs: tuple[Path, ...]) -> list[str]:
    """What tells the zips of each run apart: its folders, as named and as found inside; nothing for a single run."""
    # the root of an absolute path is a part of its own
    found = [
        "-".join(("", *Path(name).parts, *one.relative_to(run).parts)).replace("/", "")
        for name, run in zip(_names(runs), runs, strict=True)
        for one in _folders_in(run)
    ]
    if twice := [name for name in found if found.count(name) > 1]:
        raise click.UsageError(f"two runs would write the same zips, *{twice[0]}.zip: export them one by one")
    return found if len(found) > 1 else [""]


def _names(runs: tuple[Path, ...]) -> list[str]:
    """Short names that tell the runs apart."""
    short = [run.resolve().name for run in runs]
    return short if len(set(short)) == len(short) else [str(run) for run in runs]
