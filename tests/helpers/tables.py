"""Labelled datasets as tests read them: variables and rows as attributes."""

from types import SimpleNamespace


def variables(dataset):
    """The variables of a dataset as attributes: numbers and texts as they are, others as arrays."""
    values = {name: dataset[name].values for name in dataset}
    return SimpleNamespace(**{name: each.item() if each.ndim == 0 else each for name, each in values.items()})


def rows(dataset, dim):
    """What is along a dimension of a dataset, label by label, as attributes."""
    return [variables(dataset.sel(**{dim: label})) for label in dataset.labels(dim)]


def estimates(result, fit):
    """The parameters of a fit of an identification, ``update`` or ``nonlinear``."""
    found = rows(result[fit], "parameter")
    for name, each in zip(result[fit].labels("parameter"), found, strict=True):
        each.parameter = name
    return found


def modes(result, model):
    """The natural frequencies of a model of an identification."""
    return variables(result["frequencies"].groups("frequency_model")[model])


def fitted_tests(result, dim="test"):
    """The nonlinear tests of an identification that have rows along a dimension, each with its own."""
    of = result["tests"]
    parts = of.groups(f"{dim}_test") if dim != "test" else dict.fromkeys(of.labels("test"), of)
    return [variables(part.sel(test=label)) for label, part in parts.items() if part.labels(dim)]


def profiles(result):
    """The profile likelihoods of an identification; none where it has none."""
    if "profiles" not in result.datasets:
        return []
    of_points = result["profiles"].groups("point_profile")
    return [variables(part.sel(profile=label)) for label, part in of_points.items()]
