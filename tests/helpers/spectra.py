"""Spectra of a run one by one, each with its lines as records."""

from types import SimpleNamespace

COLUMNS = (
    "order", "frequency_hz", "amplitude", "amplitude_db", "phase_deg", "kind", "remainder", "separating_duration_s",
    "error",
)  # fmt: skip


def spectra_by_signal(spectra):
    """By name and quantity those of a dataset of spectra."""
    found = {}
    for number, (signal, own) in enumerate(spectra.groups("line_signal").items()):
        one = own.sel(signal=signal)
        values = {name: one[name].values for name in ("frequency_hz", "amplitude", "amplitude_db")}
        values |= {name: one[name].item() for name in ("name", "quantity", "window", "rms")}
        values |= {name: spectra[name].item() for name in ("excitation_hz", "start_s", "duration_s")}
        columns = [own[f"line_{name}"].values.tolist() for name in COLUMNS]
        lines = [SimpleNamespace(**dict(zip(COLUMNS, row, strict=True))) for row in zip(*columns, strict=True)]
        assert set(own["line_signal"].values.tolist()) <= {number}
        found[values["name"], values["quantity"]] = SimpleNamespace(**values, lines=lines)
    return found


def spectrum_of(result, quantity, name=None):
    """That of a quantity of a probe or output, by default of the first."""
    spectra = spectra_by_signal(result["spectra"]).items()
    return next(one for (place, what), one in spectra if what == quantity and name in (None, place))


def lines_of(result, quantity, name=None):
    """Its lines, the mean first."""
    return spectrum_of(result, quantity, name).lines
