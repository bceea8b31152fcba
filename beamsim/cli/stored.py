"""Result files of commands other than ``run``: what ``info`` prints and ``plot`` draws of them."""

from __future__ import annotations

from pathlib import Path

from beamsim.cli.designs import inform_about_designs

__all__ = ["command_of", "holds_designs", "plot_other", "print_other"]


def command_of(path: Path) -> str:
    """The command that wrote a result file; empty for what is no result file (whose reader then says why)."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return str(file.attrs.get("command", ""))
    except OSError:
        return ""


def holds_designs(path: Path) -> bool:
    """Whether a design study wrote the file."""
    from beamsim.store.designs import holds_designs as holds

    return holds(path)


def _holds_sweep(path: Path) -> bool:
    from beamsim.store.sweep import holds_sweep

    return holds_sweep(path)


def print_other(path: Path, *, as_json: bool) -> bool:
    """Print a result that is not a run's; False where it is one."""
    if holds_designs(path):
        inform_about_designs(path, as_json=as_json)
        return True
    if _holds_sweep(path):
        from beamsim.cli.sweep_report import print_sweep
        from beamsim.store.sweep import open_sweep

        print_sweep(open_sweep(path), [], as_json=as_json)
        return True
    if command_of(path) != "identify-stiffness":
        return False
    from beamsim.cli.identification_report import print_identification
    from beamsim.store.identification import open_identification

    print_identification(open_identification(path), [], as_json=as_json)
    return True


def plot_other(path: Path, folder: Path, form: str) -> list[Path]:
    """Draw a result that is not a run's; no files where it is one."""
    if holds_designs(path):
        from beamsim.plots.designs import save_design_plots
        from beamsim.store.designs import open_designs

        return save_design_plots(open_designs(path), folder, path.stem, form)
    if _holds_sweep(path):
        from beamsim.plots.sweep import save_sweep_plots
        from beamsim.store.sweep import open_sweep

        return save_sweep_plots(open_sweep(path), folder, path.stem, form)
    if command_of(path) != "identify-stiffness":
        return []
    from beamsim.plots.identification import save_identification_plots
    from beamsim.store.identification import open_identification

    return save_identification_plots(open_identification(path), folder, path.stem, form)
