"""Commands ``report`` and ``animate``, and the sketch of ``validate``: pictures of models and motions."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from beamsim.analyses.nnm.animation import frames_of_orbit
from beamsim.analyses.run.animation import frames_of_run
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.sweep.animation import frames_of_sweep
from beamsim.analyses.sweep.result import SweepResult
from beamsim.cli.screens import margins
from beamsim.cli.session import CommandOptions, print_files, progress_of, say
from beamsim.cli.tables import table_rows
from beamsim.errors import BeamsimError, ResultFileError
from beamsim.files import output_file, output_folder, replacement_file
from beamsim.kinds import KINDS
from beamsim.plots import animation
from beamsim.plots.animation import Scene
from beamsim.plots.bodies import stops_of
from beamsim.plots.drawing import save_figures
from beamsim.plots.model import model_figure
from beamsim.plots.sketch import Sketch
from beamsim.plots.style import use_units
from beamsim.report.contents import Printed, page_of
from beamsim.report.page import animation_page, plotly
from beamsim.scenario import Scenario
from beamsim.store.results import kind_of, stored_result
from beamsim.structures.places import Stations
from beamsim.system.build import build_system
from beamsim.system.structural import StructuralSystem

ANIMATIONS = (".gif", ".html", ".htm", ".mp4")
"""File name endings of animations."""


def draw_model(scenario: Scenario, built: StructuralSystem | None, folder: Path, stem: str) -> list[Path]:
    """Draw the model of a valid case.

    Parameters
    ----------
    scenario : scenario with bodies.
    built : its system, if it is already built.
    folder, stem : folder and stem of the picture file.

    Returns
    -------
    List with the picture.

    Raises
    ------
    ScenarioError
        If the model cannot be built.
    ResultFileError
        If the picture cannot be written.
    """
    system = built or build_system(scenario)
    with use_units(scenario.display_scales):
        return save_figures({"sketch": model_figure(_sketch_of(scenario, system))}, folder, stem)


def report(options: CommandOptions) -> None:
    """Write one HTML file about a result.

    Raises
    ------
    ResultFileError
        If the file cannot be read, or the page cannot be written.
    """
    path = options.case
    target = output_file(options.output, f"{path.stem}_report", ".html", ".htm")
    plotly()  # fail early if plotly is missing
    kind = kind_of(path)
    with stored_result(path, open_files=options.open_files) as result, use_units(result.scenario.display_scales):
        about = f"{KINDS[kind].description.replace('`', '')}, {result.created}, beamsim {result.beamsim_version}"
        figures = resolve_name(KINDS[kind].figures)(result)
        screen = resolve_name(KINDS[kind].screen)(result).text(result, [path.name])
        screen = screen.rpartition("\n")[0]  # without the list of files
        limits = margins(result, result.summary.get("margins") or {})
        model = _model(result)
        scene = _scene(result, model, shown=not (options.json or options.quiet))
        rows = list(table_rows(result))
        page = page_of(result, about, Printed(screen, rows, limits), figures, sketch_of_result(result, model), scene)
    with replacement_file(target) as temporary:
        temporary.write_text(page.html(), encoding="utf-8")
    print_files([target], json=options.json)


def animate(options: CommandOptions) -> None:
    """Write the motion of a result as GIF and HTML, or as the single file that is named (also a video).

    Raises
    ------
    ResultFileError
        If the file cannot be read or has no motion, a file cannot be written, or ffmpeg is missing for a video.
    """
    path, output = options.case, options.output
    if output is not None and output.suffix.lower() in ANIMATIONS and not output.is_dir():
        targets = [output_file(output, path.stem, output.suffix.lower())]
        if output.suffix.lower() == ".mp4":
            animation.demand_ffmpeg(output)
    else:
        folder = output_folder(output, path.stem, *ANIMATIONS)
        targets = [folder / f"{path.stem}_animation{suffix}" for suffix in (".gif", ".html")]
    shown = not (options.json or options.quiet)
    with stored_result(path, open_files=options.open_files) as result, use_units(result.scenario.display_scales):
        scene = scene_of(result, shown=shown, sweeps=True)
        if scene is None:
            remedy = "animate a run, a sweep or a nonlinear mode of a model with nodes that move"
            raise ResultFileError(f"{path}: holds no motion of places; {remedy}")
        for target in targets:
            if target.suffix.lower() in (".gif", ".mp4"):
                save = animation.save_gif if target.suffix.lower() == ".gif" else animation.save_video
                with progress_of(f"drawing {target.name}", shown=shown) as progress:
                    save(scene, target, progress)
            else:
                with replacement_file(target) as temporary:
                    temporary.write_text(animation_page(scene), encoding="utf-8")
    print_files(targets, json=options.json)


def _scene(result: Any, model: StructuralSystem | None, *, shown: bool) -> Scene | None:
    """Animation for a report; None if the model cannot be built again."""
    try:
        return scene_of(result, model, shown=shown)
    except BeamsimError as error:
        say(f"beamsim: the report has no animation: {error}")
        return None


def _sketch_of(scenario: Scenario, system: StructuralSystem) -> Sketch:
    return Sketch(scenario, system.stations, {stop.name: stop for stop in system.snubbers})


def sketch_of_result(result: Any, model: StructuralSystem | None) -> Sketch | None:
    """Sketch of a result, with the values of a run; None if the model is unknown (not for a run)."""
    if isinstance(result, RunResult):
        return Sketch(
            result.scenario.model_copy(update={"sweep": None}), Stations.of_modes(result["modes"]), stops_of(result)
        )
    return None if model is None else _sketch_of(result.scenario.model_copy(update={"run": None}), model)


def _model(result: Any) -> StructuralSystem | None:
    """Model of the result's scenario; None if it has no bodies or cannot be built."""
    if not result.scenario.all_bodies:
        return None
    try:
        return build_system(result.scenario)
    except BeamsimError as error:
        if not isinstance(result, RunResult):  # a run has the numbers of its sketch
            say(f"beamsim: the report has no sketch of the model: {error}")
        return None


def scene_of(result: Any, model: StructuralSystem | None = None, *, shown: bool, sweeps: bool = False) -> Scene | None:
    """Animation of a run, of a stored periodic motion, or of the highest peak of a sweep.

    Parameters
    ----------
    result : result of any kind.
    model : model of its scenario, if it is already built.
    shown : True to report the progress.
    sweeps : True to compute sweeps again, which takes as long as before.

    Returns
    -------
    None for results without a motion to draw.

    Raises
    ------
    ScenarioError
        See `frames_of_run`; also if the model of a periodic motion cannot be built again.
    """
    if isinstance(result, RunResult):
        with progress_of("computing the motion again", shown=shown) as progress:
            frames = frames_of_run(result, progress, model=model)
    elif isinstance(result, SweepResult):
        with progress_of("computing the sweep again", shown=shown) as progress:
            of_sweep = frames_of_sweep(result, progress) if sweeps else None
        if of_sweep is None:
            return None
        model, frames = model or build_system(result.scenario), of_sweep
    else:
        if "motion" not in result.datasets:
            return None
        model = model or build_system(result.scenario)
        frames = frames_of_orbit(model, Stations.of_modes(result["modes"]), result["motion"])
    sketch = sketch_of_result(result, model)
    return None if sketch is None or not frames.deflection.any() else animation.scene_of(frames, sketch, result.title)
