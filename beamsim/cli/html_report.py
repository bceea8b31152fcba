"""The commands ``report`` and ``animate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from beamsim.cli.failures import guarded, say
from beamsim.cli.options import Debug, Json, Output, Quiet, Stored
from beamsim.kinds import KINDS, named

if TYPE_CHECKING:
    from beamsim.analyses.animate.frames import BuiltModel
    from beamsim.plots.animation import Scene
    from beamsim.report.contents import SketchedModel


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("report")(report)
    app.command("animate")(animate)


@guarded
def report(
    result: Stored,
    output: Output = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write one HTML file about a result. It has verdict, model, numbers, plots, animation, checks and scenario."""
    from beamsim.cli.output import output_file
    from beamsim.cli.printing import print_files

    target = output_file(output, f"{result.stem}_report", ".html", ".htm")
    print_files([_write(result, target, shown=not (json or quiet))], as_json=json)


def _write(path: Path, target: Path, *, shown: bool) -> Path:
    from beamsim.cli.report import table_rows
    from beamsim.files import replacing
    from beamsim.plots.style import shown_in
    from beamsim.report.contents import page_of
    from beamsim.report.page import plotly
    from beamsim.store.consistency import open_consistent
    from beamsim.store.results import kind_of

    plotly()  # that it is missing is said before anything is computed
    kind = kind_of(path)
    result: Any = open_consistent(path)
    _note_unknown_files(result)
    with shown_in(result.scenario.display_scales):
        about = f"{KINDS[kind].called.replace('`', '')}, {result.created}, beamsim {result.beamsim_version}"
        figures = named(KINDS[kind].figures)(result)
        rows = list(table_rows(kind, result))
        model = _model(result)
        page = page_of(result, about, rows, figures, _sketched(result, model), _scene(result, model, shown=shown))
    with replacing(target) as temporary:
        temporary.write_text(page.html(), encoding="utf-8")
    return target


@guarded
def animate(
    result: Stored,
    output: Output = None,
    json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write the motion of a result as a GIF and as HTML. It is slow around contact."""
    from beamsim.cli.output import output_file, output_folder
    from beamsim.cli.printing import print_files
    from beamsim.cli.progress import progress_of
    from beamsim.errors import ResultFileError
    from beamsim.files import replacing
    from beamsim.plots.animation import save_gif
    from beamsim.plots.style import shown_in
    from beamsim.report.animated import animation_page
    from beamsim.store.consistency import open_consistent

    if output is not None and output.suffix.lower() in (".gif", ".html", ".htm"):
        targets = [output_file(output, result.stem, output.suffix.lower())]
    else:
        folder = output_folder(output, result.stem)
        targets = [folder / f"{result.stem}_animation{suffix}" for suffix in (".gif", ".html")]
    shown = not (json or quiet)
    stored: Any = open_consistent(result)
    _note_unknown_files(stored)
    with shown_in(stored.scenario.display_scales):
        scene = scene_of(stored, shown=shown)
        if scene is None:
            raise ResultFileError(f"{result}: holds no motion; animate the result of `beamsim run` or `beamsim nnm`")
        for target in targets:
            if target.suffix.lower() == ".gif":
                with progress_of(f"drawing {target.name}", shown=shown) as progress:
                    save_gif(scene, target, progress)
            else:
                with replacing(target) as temporary:
                    temporary.write_text(animation_page(scene), encoding="utf-8")
    print_files(targets, as_json=json)


def _note_unknown_files(result: Any) -> None:
    """Say that files may be others than those that were solved, of a result that does not know them."""
    from beamsim.scenario.input_files import named_files

    if result.input_files is None and any(named_files(result.scenario)):
        say("beamsim: note: an earlier version wrote this result: files of the case may have changed since")


def _scene(result: Any, model: BuiltModel | None, *, shown: bool) -> Scene | None:
    """The animation for a report, which does without where the model cannot be built again."""
    from beamsim.errors import BeamsimError

    try:
        return scene_of(result, model, shown=shown)
    except BeamsimError as error:
        say(f"beamsim: the report has no animation: {error}")
        return None


def _sketched(result: Any, model: BuiltModel | None) -> SketchedModel | None:
    """What the sketch shows: of the model, or where that cannot be built of the result, if this is a run."""
    from beamsim.analyses.run.result import RunResult
    from beamsim.report.contents import SketchedModel

    if model is not None:
        return SketchedModel(model.system.stations, {stop.name: stop for stop in model.system.snubbers})
    if isinstance(result, RunResult):
        return SketchedModel(result.modes.stations, result.snubbers)
    return None


def _model(result: Any) -> BuiltModel | None:
    """The model of the result's scenario; None where it has no bodies or cannot be built."""
    from beamsim.analyses.animate.frames import model_of
    from beamsim.analyses.run.result import RunResult
    from beamsim.errors import BeamsimError

    if not result.scenario.all_bodies:
        return None
    try:
        return model_of(result.scenario)
    except BeamsimError as error:
        if not isinstance(result, RunResult):  # whose own numbers are sketched
            say(f"beamsim: the report has no sketch of the model: {error}")
        return None


def scene_of(result: Any, model: BuiltModel | None = None, *, shown: bool) -> Scene | None:
    """The animation of a run or of a stored periodic motion; None of results without a motion.

    ``model`` is that of its scenario, where it was built already.
    """
    from beamsim.analyses.animate.frames import frames_of_orbit, frames_of_run, model_of
    from beamsim.analyses.run.result import RunResult
    from beamsim.cli.progress import progress_of
    from beamsim.plots.animation import scene_of as scene_of_frames

    if isinstance(result, RunResult):
        with progress_of("computing the motion again", shown=shown) as progress:
            frames = frames_of_run(result, progress, model=model)
        return scene_of_frames(frames, result.scenario, result.modes.stations, result.snubbers, result.title)
    motion = next((b.motion for b in getattr(result, "branches", ()) if getattr(b, "motion", None) is not None), None)
    if motion is None:
        return None
    stations = result.modes.stations
    stops = {stop.name: stop for stop in (model or model_of(result.scenario)).system.snubbers}
    return scene_of_frames(
        frames_of_orbit(result.scenario, stations, motion), result.scenario, stations, stops, result.title
    )
