"""The command-line application: all commands and their options.

Each command imports its implementation when it runs, so that ``beamsim --help`` is fast.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from functools import partial
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from beamsim.cli.session import CommandOptions, with_exit_code
from beamsim.errors import MOST_HOURS, allowing_hours
from beamsim.files import protected_files
from beamsim.kinds import TemplateKind

COMPUTATION_OPTIONS = ("overrides", "output", "json", "no_plots", "quiet", "verbose", "allow_hours")
RESULT_OPTIONS = ("output", "json", "quiet")


Case = Annotated[Path, typer.Argument(metavar="CASE.YAML", help="Scenario file, or a result file to take the case of.")]
Stored = Annotated[Path, typer.Argument(metavar="CASE.H5", help="Result file.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Override a value, e.g. beam.thickness='4 mm'; repeatable."),
]


def _not_empty(text: str) -> Path:
    if not text.strip():
        raise typer.BadParameter("it is empty; give a file or a folder, or leave it out for the current one")
    return Path(text)


def _quantity(unit: str, least: float = -math.inf, most: float = math.inf) -> Callable[[Any], float]:
    """Parser for numbers with or without a unit, by the rules of scenarios.

    Parameters
    ----------
    unit : unit of the result, and of a number without unit; empty for ratios.
    least, most : bounds in that unit.
    """

    def read(text: Any) -> float:
        number = _number_in(text, unit) if isinstance(text, str) else float(text)  # the default
        if not least <= number <= most:
            raise typer.BadParameter(f"{text} is outside {least:g} to {most:g}")
        return number

    return read


def _number_in(text: str, unit: str) -> float:
    """Number that a user entered, converted to a unit (also the default unit)."""
    from beamsim.scenario import units

    of = units.RATIO if unit in ("", "%") else units.TIME
    try:
        number, written = units.read_level(text, (of,))
        return number / (units.size_of(unit, of) if written is not None and unit else 1.0)
    except units.UnitError as error:
        raise typer.BadParameter(f"{text} {error.message}; {error.remedy}") from None


Output = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="PATH",
        parser=_not_empty,
        help="File or folder for the results (default: current folder).",
    ),
]
OPTIONS: dict[str, tuple[Any, Any]] = {
    "overrides": (Overrides, None),
    "output": (Output, None),
    "json": (Annotated[bool, typer.Option("--json", help="Print only one JSON object on standard output.")], False),
    "no_plots": (Annotated[bool, typer.Option("--no-plots", help="Write the result file only.")], False),
    "quiet": (Annotated[bool, typer.Option("--quiet", "-q", help="No progress report and no summary.")], False),
    "verbose": (
        Annotated[bool, typer.Option("--verbose", "-v", help="Print everything: the whole table and all notes.")],
        False,
    ),
    "allow_hours": (
        Annotated[
            float,
            typer.Option(
                "--allow-hours",
                metavar="HOURS",
                parser=_quantity("h", 0.0),
                help="End with exit code 2 if it would take longer, as estimated before the start or soon after it.",
            ),
        ],
        MOST_HOURS,
    ),
    "check": (
        Annotated[bool, typer.Option("--check", help="Exit with code 4 if a limit is exceeded, 3 if it may be.")],
        False,
    ),
    "resume": (
        Annotated[
            bool,
            typer.Option("--resume", help="Go on from what an interrupted command has kept; else begin again."),
        ],
        False,
    ),
    "open_files": (
        Annotated[bool, typer.Option("--open-files", help="Open the matrices and records that the result names.")],
        False,
    ),
    "debug": (Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")], False),
}  # fmt: skip
"""Typer declaration and default of each field of `CommandOptions`, and of ``debug``."""

app = typer.Typer(
    name="beamsim",
    help="Exact simulation of structures that vibrate against one-sided elastic stops.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def command(function: Callable[..., None], *, file: Any, options: Sequence[str]) -> Callable[..., None]:
    """Create a command from a function that takes the shared options as one `CommandOptions`.

    Parameters
    ----------
    function : takes a `CommandOptions`, and its own arguments and options.
    file : argument for the file of the command; None if it has none.
    options : names of its shared options from `OPTIONS`, besides ``--debug``.

    Returns
    -------
    The function.
    """
    keyword = Parameter.POSITIONAL_OR_KEYWORD
    own = list(signature(function, eval_str=True).parameters.values())[1:]
    parameters = [Parameter("case", keyword, annotation=file)] if file is not None else []
    parameters += sorted(own, key=lambda parameter: parameter.default is not Parameter.empty)  # arguments first
    for name in (*options, "debug"):
        annotation, default = OPTIONS[name]
        parameters.append(Parameter(name, keyword, default=default, annotation=annotation))

    def called(debug: bool, **values: Any) -> None:
        shared = CommandOptions(**{name: values.pop(name) for name in CommandOptions._fields if name in values})
        read = [shared.case]
        for name, value in values.items():
            if name != "file":  # which is written
                read += value if isinstance(value, list) else [value]
        paths = (path for path in read if isinstance(path, Path) and path != Path())
        with with_exit_code(debug=debug), allowing_hours(shared.allow_hours), protected_files(paths):
            function(shared, **values)

    called.__name__, called.__doc__ = function.__name__, function.__doc__
    vars(called).update(__signature__=Signature(parameters))  # Typer reads it
    app.command()(called)
    return function


DecimalOption = Annotated[
    Literal[".", ","] | None,
    typer.Option("--decimal", help="Decimal mark of a text file; by default what its numbers show."),
]


AgainstOption = Annotated[
    str | None,
    typer.Option(
        "--against",
        metavar="reference[:RTOL]",
        help="Compare with the reference integrator, at a relative tolerance of 1e-8 or as given.",
    ),
]


class ComparedMethod(StrEnum):
    """Methods of ``beamsim nnm --compare``."""

    multiple_scales = "multiple_scales"
    relaxed_minimisation = "relaxed_minimisation"


@partial(command, file=Case, options=(*COMPUTATION_OPTIONS, "check"))
def run(options: CommandOptions, against: AgainstOption = None) -> None:
    """Simulate a case. Writes a result file and plots, prints a summary."""
    from beamsim.cli.command import run_analysis

    if against is None:
        run_analysis("run", options, "simulating")
        return
    from beamsim.trust import reference  # which runs without it do not load

    rtol = reference.tolerance_of(against)
    run_analysis(
        "run", options, "simulating", lambda result, stop: reference.compare_with_reference(result, rtol, stop)
    )


@partial(command, file=Case, options=(*COMPUTATION_OPTIONS, "check"))
def static(options: CommandOptions) -> None:
    """Find static equilibrium under weight and dead loads. Prints which stops touch, reactions, frequencies."""
    from beamsim.cli.command import run_analysis

    run_analysis("static", options, "finding the equilibrium of")


@partial(command, file=Case, options=(*COMPUTATION_OPTIONS, "check", "resume"))
def sweep(
    options: CommandOptions,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            min=1,
            help="Processes for vary or coexisting motions; by default one per core where the cases take long enough.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler for them, tcp://host:port.")
    ] = None,
    wait_for_workers: Annotated[
        float | None,
        typer.Option(
            "--wait-for-workers",
            metavar="TIME",
            parser=_quantity("s", 0.0),
            help="Longest time that the scheduler may be without any worker; 600 by default.",
        ),
    ] = None,
    compare_with: Annotated[
        Literal["multiple_scales"] | None,
        typer.Option("--compare", help="Compare a continuation with the multiple-scales expansion."),
    ] = None,
    overlay: Annotated[
        list[Path] | None, typer.Option("--overlay", help="Overlay a stored sweep on a continuation; repeatable.")
    ] = None,
) -> None:
    """Sweep the frequency, or vary numbers of the case. Writes a result file and plots."""
    from beamsim.cli.sweeps import swept

    own_options = {
        "workers": workers, "scheduler": scheduler, "wait_for_workers": wait_for_workers, "overlay": overlay,
        "compare": compare_with,
    }  # fmt: skip
    swept(options, own_options)


@partial(command, file=Case, options=COMPUTATION_OPTIONS)
def nnm(
    options: CommandOptions,
    compare_with: Annotated[
        list[ComparedMethod] | None,
        typer.Option("--compare", help="Compare another method with the exact mode; repeatable."),
    ] = None,
) -> None:
    """Follow a nonlinear normal mode. In stiffness factor, energy or frequency. Writes a file and plots."""
    from beamsim.cli.command import run_analysis

    methods = [method.value for method in compare_with or ()]
    run_analysis("nnm", options, "following the mode of", compare=methods)


@partial(command, file=Case, options=COMPUTATION_OPTIONS)
def identify_stiffness(options: CommandOptions) -> None:
    """Find stiffness and damping of stops from tests. Parameters of the structure itself can be found with them."""
    from beamsim.cli.identification import identify

    identify(options)


Compared = Annotated[
    Path,
    typer.Argument(
        metavar="FIRST", help="Result of a run or sweep; or test data before another test, or a case with before_after."
    ),
]


@partial(command, file=Compared, options=(*COMPUTATION_OPTIONS, "check"))
def compare(
    options: CommandOptions,
    measured: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MEASURED]", help="Measured signals, or test data after: .uff, .csv, .h5, .mat, .tdms, .mf4, ..."
        ),
    ] = None,
    channel: Annotated[
        list[str] | None,
        typer.Option("--channel", help="Channel of the measurement. Of two tests repeatable; BEFORE=AFTER if renamed."),
    ] = None,
    probe: Annotated[str | None, typer.Option("--probe", help="Probe (or snubber) to compare with.")] = None,
    quantity: Annotated[str | None, typer.Option("--quantity", help="E.g. absolute_acceleration, force.")] = None,
    unit: Annotated[
        str | None, typer.Option("--unit", help="Unit of the measurement, e.g. g, where the file states none.")
    ] = None,
    axis_unit: Annotated[
        str | None, typer.Option("--axis-unit", help="Unit of its times or frequencies, e.g. ms, likewise.")
    ] = None,
    factor: Annotated[
        str | None, typer.Option("--factor", help="Multiply measured values: -1 of a sensor that is upside down.")
    ] = None,
    remove: Annotated[
        Literal["mean", "trend"] | None, typer.Option("--remove", help="Take this away from measured histories.")
    ] = None,
    high_pass: Annotated[
        str | None, typer.Option("--high-pass", help="-3 dB frequency of a high-pass filter for them, e.g. '5 Hz'.")
    ] = None,
    level: Annotated[
        str | None, typer.Option("--level", help="Excitation at which a frequency response was measured, e.g. '2 g'.")
    ] = None,
    decimal: DecimalOption = None,
    harmonics: Annotated[int, typer.Option("--harmonics", min=1, help="Number of harmonics in the table.")] = 10,
    last: Annotated[
        float | None,
        typer.Option(
            "--last",
            metavar="TIME",
            parser=_quantity("s", 0.0),
            help="Use only the last part of the measurement, e.g. '0.5 s'.",
        ),
    ] = None,
    curve: Annotated[str | None, typer.Option("--curve", help="Curve of a sweep, e.g. up_0.")] = None,
    detector: Annotated[
        Literal["peak", "fundamental", "rms"] | None,
        typer.Option("--detector", help="What the measurement of a sweep shows of each cycle."),
    ] = None,
    reference: Annotated[
        str | None, typer.Option("--reference", help="Channel of the excitation, in time histories of a test.")
    ] = None,
    begin: Annotated[
        float | None,
        typer.Option(
            "--begin",
            metavar="TIME",
            parser=_quantity("s"),
            help="Time of such a record at which the sweep begins, e.g. '2 s'.",
        ),
    ] = None,
    cycles: Annotated[
        int, typer.Option("--cycles", min=1, help="Track such a record over so many cycles: bandwidth is f / cycles.")
    ] = 1,
    sweep: Annotated[
        str | None,
        typer.Option("--sweep", metavar="FROM,TO,RATE", help="Sine sweep of two tests: '20 Hz, 200 Hz, 2 oct/min'."),
    ] = None,
    sweep_after: Annotated[
        str | None, typer.Option("--sweep-after", metavar="FROM,TO,RATE", help="The same of the test after, if other.")
    ] = None,
    line_spacing: Annotated[
        str | None, typer.Option("--line-spacing", help="Distance of the lines of two random tests, e.g. '1 Hz'.")
    ] = None,
) -> None:
    """Compare a result with a test, or a test before with one after. Prints differences of harmonics or resonances."""
    from beamsim.cli.comparisons import compare_signals, compare_tests, is_result

    of_tests = {"sweep": sweep, "sweep_after": sweep_after, "line_spacing": line_spacing}
    of_results = {
        "probe": probe, "quantity": quantity, "level": level, "last": last, "curve": curve, "detector": detector,
        "harmonics": None if harmonics == 10 else harmonics,
    }  # fmt: skip
    if measured is None or not is_result(options.case):
        given = {
            "channel": channel, "unit": unit, "axis_unit": axis_unit, "factor": factor, "remove": remove,
            "high_pass": high_pass, "decimal": decimal, "reference": reference,
            "begin": begin, "cycles": None if cycles == 1 else cycles, **of_tests,
        }  # fmt: skip
        compare_tests(options, measured, given, refused=of_results)
        return
    pairing = {
        "channel": channel, "place": probe, "quantity": quantity, "unit": unit, "axis_unit": axis_unit, "level": level,
        "decimal": decimal,
    }  # fmt: skip
    prepared = {"factor": factor, "remove": remove, "high_pass": high_pass}
    of_runs = {"harmonics": harmonics, "last": last}
    of_sweeps = {"curve": curve, "detector": detector, "reference": reference, "begin": begin, "cycles": cycles}
    compare_signals(options, measured, pairing, prepared, of_runs, of_sweeps, refused=of_tests)


@partial(command, file=Case, options=COMPUTATION_OPTIONS)
def compare_modes(
    options: CommandOptions,
    measured: Annotated[Path, typer.Argument(metavar="SHAPES", help="Measured mode shapes: .csv, or .uff dataset 55.")],
    decimal: DecimalOption = None,
    closed: Annotated[bool, typer.Option("--closed", help="Compute the modes with every snubber closed.")] = False,
    least_mac: Annotated[
        float | None,
        typer.Option(
            "--least-mac",
            metavar="RATIO",
            parser=_quantity("", 0.0, 1.0),
            help="Exit with code 4 if the MAC of a pair is lower, e.g. 0.9.",
        ),
    ] = None,
    most_difference: Annotated[
        float | None,
        typer.Option(
            "--most-difference",
            metavar="PERCENT",
            parser=_quantity("%", 0.0),
            help="Exit with code 4 if frequencies differ by more, %.",
        ),
    ] = None,
) -> None:
    """Pair measured with computed modes by their MAC. Prints frequencies, differences and MAC."""
    from beamsim.cli.comparisons import compare_shapes

    limits = {"least_mac": least_mac, "most_difference": most_difference}
    compare_shapes(options, measured, "closed" if closed else "open", limits, decimal)


@partial(command, file=Stored, options=("json",))
def info(options: CommandOptions) -> None:
    """Print the contents of a result file, or the channels of a record."""
    from beamsim.cli import stored

    stored.info(options)


@partial(command, file=Stored, options=RESULT_OPTIONS)
def plot(
    options: CommandOptions,
    form: Annotated[Literal["png", "pdf", "svg"], typer.Option("--format", help="Picture format.")] = "png",
) -> None:
    """Plot a result file again without recomputing it."""
    from beamsim.cli import stored

    stored.plot(options, form)


@partial(command, file=Stored, options=RESULT_OPTIONS)
def export(
    options: CommandOptions,
    form: Annotated[
        Literal["csv", "uff", "mat"] | None,
        typer.Option("--format", help="csv (mostly a folder of tables), uff or mat; default: by the name after -o."),
    ] = None,
) -> None:
    """Write a result file in another format."""
    from beamsim.cli import stored

    stored.export(options, form)


@partial(command, file=Stored, options=(*RESULT_OPTIONS, "open_files"))
def report(
    options: CommandOptions,
) -> None:
    """Write one HTML file about a result. It has verdict, model, numbers, plots, animation, checks and scenario."""
    from beamsim.cli import html_report

    html_report.report(options)


@partial(command, file=Stored, options=(*RESULT_OPTIONS, "open_files"))
def animate(
    options: CommandOptions,
) -> None:
    """Write the motion of a result as a GIF and as HTML. Slow around contact; -o NAME.mp4 writes a video (ffmpeg)."""
    from beamsim.cli import html_report

    html_report.animate(options)


@partial(command, file=Case, options=("overrides", "output", "json"))
def validate(
    options: CommandOptions,
    sketch: Annotated[
        bool, typer.Option("--sketch", help="Draw the model: bodies, supports, masses, springs and stops.")
    ] = False,
) -> None:
    """Check a case without running it. Reports every problem with file, line and remedy."""
    from beamsim.cli import cases

    cases.validate(options, sketch=sketch)


@partial(command, file=None, options=("output", "json"))
def schema(options: CommandOptions) -> None:
    """Print the JSON Schema of scenario files. Editors complete and check them by it."""
    from beamsim.cli import cases

    cases.write_schema(options.output)


@partial(command, file=None, options=("json",))
def new(
    options: CommandOptions,
    file: Annotated[Path, typer.Argument(metavar="CASE.YAML", help="File to write.")] = Path("case.yaml"),
    kind: Annotated[TemplateKind, typer.Option("--kind", help="What to simulate.")] = TemplateKind.beam,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a commented scenario to start from, and the schema by which editors check and complete it."""
    from beamsim.cli import cases

    cases.write_template(file, kind, force=force, as_json=options.json)


@partial(command, file=Case, options=("overrides", "json"))
def check(options: CommandOptions) -> None:
    """Check the matrices of each body. Mass, rigid motions, symmetry, frequencies. Exit code 3 if a check fails."""
    from beamsim.cli import structures

    structures.check(options)


@partial(command, file=Case, options=("overrides", "output", "json"))
def export_structure(
    options: CommandOptions,
    body: Annotated[str | None, typer.Option("--body", help="Write one body by itself, without its joints.")] = None,
    modes: Annotated[
        int | None,
        typer.Option(
            "--modes",
            min=1,
            help="Write a Craig-Bampton model with this many modes; its boundary is where something acts.",
        ),
    ] = None,
    units: Annotated[
        str, typer.Option("--units", help="Units of the files: SI, mm-t-s, mm-kg-ms, in-lbf-s, ... as in the scenario.")
    ] = "SI",
    binary: Annotated[bool, typer.Option("--binary", help="Write OP4 in binary instead of ASCII.")] = False,
) -> None:
    """Write the matrices of the structure. OP4 (default), MATLAB, MatrixMarket or NumPy files, and a table of nodes."""
    from beamsim.cli import structures

    structures.export(options, body, modes, units, binary=binary)


@partial(command, file=None, options=("quiet", "json"))
def warmup(options: CommandOptions) -> None:
    """Compile the numerical kernels beforehand, for images and installers. Prints the folder where they are kept."""
    from beamsim.cli.warmup import compile_kernels

    compile_kernels(shown=not (options.quiet or options.json), as_json=options.json)


_of_pad = partial(typer.Option, metavar="QUANTITY")


@partial(command, file=None, options=("json",))
def pad(
    options: CommandOptions,
    modulus: Annotated[str | None, _of_pad("--modulus", help="Young's modulus of the pad, e.g. '5 MPa'.")] = None,
    area: Annotated[str | None, _of_pad("--area", help="Loaded area, e.g. '4 cm^2'.")] = None,
    height: Annotated[str | None, _of_pad("--height", help="Height, e.g. '6 mm'.")] = None,
    shape_factor: Annotated[
        str | None,
        _of_pad("--shape-factor", help="Loaded over free area of a pad whose faces are held; 0 by default."),
    ] = None,
    curve: Annotated[Path | None, typer.Option("--curve", help="CSV file of force over deflection.")] = None,
    segments: Annotated[
        int, typer.Option("--segments", min=1, max=50, help="Number of straight lines fitted to the curve.")
    ] = 5,
    column: Annotated[
        list[str] | None,
        typer.Option("--column", help="Column of the curve that is meant, if several have its dimension; repeatable."),
    ] = None,
    decimal: DecimalOption = None,
    loss_factor: Annotated[str | None, _of_pad("--loss-factor", help="Loss factor at --frequency.")] = None,
    frequency: Annotated[str | None, _of_pad("--frequency", help="Frequency of the dashpot, e.g. '65 Hz'.")] = None,
) -> None:
    """Find stiffness and dashpot of a snubber's pad. From its material or a measured curve; prints YAML."""
    from beamsim.cli import pad as pads

    texts = {
        "modulus": modulus, "area": area, "height": height, "shape_factor": shape_factor, "loss_factor": loss_factor,
        "frequency": frequency,
    }  # fmt: skip
    of_curve = {"curve": curve, "segments": segments, "columns": tuple(column or ()), "decimal": decimal}
    pads.pad(texts, of_curve, as_json=options.json)


def _version(show: bool) -> None:
    if show:
        from beamsim.version import __version__

        print(f"beamsim {__version__}")
        raise typer.Exit


VersionOption = Annotated[
    bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
]


@app.callback()
def _options(version: VersionOption = False) -> None:
    pass
