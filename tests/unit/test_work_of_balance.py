"""Work of harmonic balance along a response curve: counted, not timed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import beamsim
from beamsim.orbits.condensation import Condensation
from beamsim.orbits.harmonic_balance import ForcedBalance

CASE = Path(__file__).parents[2] / "configs" / "one_sided_65hz.yaml"


def test_stability_is_found_once_a_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = {"spectra": 0, "coordinates": 0, "residuals": 0}

    def counted(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def with_count(*args: Any, **kwargs: Any) -> Any:
            counts[name] += 1
            return function(*args, **kwargs)

        return with_count

    monkeypatch.setattr(ForcedBalance, "_multipliers", counted("spectra", ForcedBalance._multipliers))
    monkeypatch.setattr(ForcedBalance, "residual", counted("residuals", ForcedBalance.residual))
    monkeypatch.setattr(Condensation, "coordinates", counted("coordinates", Condensation.coordinates))
    method = {"kind": "harmonic_balance", "harmonics": 31}
    sweep = {"kind": "continuation", "from": 84.0, "to": 88.0, "method": method, "seek_at": 0}
    result = beamsim.frequency_response(beamsim.load_scenario(CASE, {"sweep": sweep}))
    points = sum(branch.parameter.size for branch in result.branches)
    assert any(event.kind == "fold" for branch in result.branches for event in branch.special)
    # searches for special points and maxima look at motions that are not stored; every motion takes several residuals
    assert counts["spectra"] <= 2 * points
    assert counts["coordinates"] <= 2 * points < 0.5 * counts["residuals"]
    stable = np.concatenate([branch.stable for branch in result.branches])
    assert stable.any()
    assert not stable.all()
