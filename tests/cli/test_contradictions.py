"""Result files whose curves contradict their figures are refused by what would draw or export them."""

import shutil
from pathlib import Path

import h5py
import pytest

import beamsim
from beamsim.errors import ResultFileError
from tests.helpers.commands import invoke

CASE = """
chain: {masses: [1 kg], springs: [1 kN/m], snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, stiffness: 1e5}]}
excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2 g}
probes: [{name: mass, mass: 1}]
run: {duration: 0.4 s, convergence: off, spectrum: {last: 0.2 s}}
"""
KINDS = {  # command, sections, a curve
    "run": ("run", "", "histories/displacement"),
    "base": ("run", "", "histories/base_displacement"),
    "sweep": (
        "sweep", "sweep: {kind: swept_sine, from: 9 Hz, to: 10 Hz, rate: 2 Hz/s, direction: up, convergence: off}",
        "cycles/max_displacement",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


def result_of(name, folder):
    command, sections, _ = KINDS[name]
    target = folder / f"{name}.h5"
    if not target.exists():
        (folder / "case.yaml").write_text(CASE + sections)
        done = invoke(command, folder / "case.yaml", "--no-plots", "--quiet", "-o", target)
        assert done.exit_code == 0, done.output
    return target


COMMANDS = [["plot"], ["report"], ["animate"], *(["export", "--format", form] for form in ("csv", "uff", "mat"))]


def flip_a_bit(path, dataset):
    """Flip one bit in the middle of the stored values of a dataset."""
    with h5py.File(path) as file:
        chunk = file[dataset].id.get_chunk_info(0)
    data = bytearray(path.read_bytes())
    data[chunk.byte_offset + chunk.size // 2] ^= 0x10
    path.write_bytes(data)


@pytest.mark.parametrize("name", KINDS)
def test_a_flipped_bit_is_named_with_its_dataset(name, folder, tmp_path, without_examination):
    """The checksums of HDF5 find it, whatever it does to the numbers."""
    damaged = Path(shutil.copy(result_of(name, folder), tmp_path / "case.h5"))
    flip_a_bit(damaged, KINDS[name][2])
    for command in [["info"], *(COMMANDS if name == "run" else COMMANDS[:1])]:
        done = invoke(*command, damaged, *([] if command == ["info"] else ["-o", tmp_path]))
        assert done.exit_code == 2, (command, done.output)
        assert f"case.h5: damaged (/{KINDS[name][2]} cannot be read" in done.output
        assert "run the case again" in done.output
    assert [path.name for path in tmp_path.iterdir()] == ["case.h5"]


@pytest.mark.parametrize("name", KINDS)
def test_every_array_of_numbers_has_a_checksum(name, folder):
    without = []

    def look(path, item):
        numbers = isinstance(item, h5py.Dataset) and item.dtype.kind in "iufc" and item.ndim and item.size
        without.extend([path] if numbers and not item.fletcher32 else [])

    with h5py.File(result_of(name, folder)) as file:
        file.visititems(look)
    assert without == []


def test_a_motion_that_vanishes_but_for_round_off_is_no_damage(tmp_path):
    """Mode 2 of a pinned beam does not move its middle: the peak there is 0, and the history holds 1e-17 m."""
    (tmp_path / "case.yaml").write_text("""
beam:
  {length: 1 m, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3, elements: 20,
   supports: {left: pinned, right: pinned}, damping: {kind: modal, ratio: 1 %}}
probes: [{name: quarter, position: 25 %}, {name: mid, position: 50 %}]
run: {duration: 0.05 s, sample_rate: 5 kHz, start: {mode: 2, amplitude: 1 mm}, convergence: off}
""")
    target = tmp_path / "case.h5"
    done = invoke("run", tmp_path / "case.yaml", "--no-plots", "-o", target)
    assert done.exit_code == 0, done.output
    result = beamsim.load(target)
    assert result.summary["peak_displacement_m"]["mid"] == 0.0
    for command in [["info"], *COMMANDS]:
        done = invoke(*command, target, *([] if command == ["info"] else ["-o", tmp_path]))
        assert done.exit_code == 0, (command, done.output)


@pytest.mark.parametrize("name", KINDS)
def test_one_that_does_not_is_exported(name, folder, tmp_path):
    done = invoke("export", "--format", "mat", result_of(name, folder), "-o", tmp_path)
    assert done.exit_code == 0, done.output


def pulse(duration, asked):
    excitation = f"{{kind: half_sine, applied_to: base, level: 1 g, duration: {duration} s}}"
    text = CASE.replace("{kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2 g}", excitation)
    return text.replace("spectrum: {last: 0.2 s}", f"sample_rate: 1 kHz, {asked}")


def test_a_pulse_too_short_for_a_shock_response_spectrum_is_named(tmp_path):
    (tmp_path / "case.yaml").write_text(pulse(1e-12, "srs: {from: 10 Hz, to: 1 kHz}"))
    done = invoke("run", tmp_path / "case.yaml", "--no-plots", "-o", tmp_path / "case.h5")
    assert done.exit_code == 2
    assert "case.yaml:5: run asks for run.srs or run.low_pass, which would take " in done.output
    assert "the shortest pulse" in done.output


def test_behind_a_filter_a_short_pulse_is_an_impulse(tmp_path):
    peaks = []
    for duration in (1e-6, 1e-12):
        (tmp_path / "case.yaml").write_text(pulse(duration, "low_pass: 1 kHz"))
        peaks.append(beamsim.run(beamsim.load_scenario(tmp_path / "case.yaml")).summary["peak_acceleration_g"]["mass"])
    assert 0.0 < peaks[1] == pytest.approx(1e-6 * peaks[0], rel=1e-5)


def test_the_python_function_refuses_it_too(folder, tmp_path, without_examination):
    damaged = Path(shutil.copy(result_of("run", folder), tmp_path / "case.h5"))
    flip_a_bit(damaged, "histories/displacement")
    with pytest.raises(ResultFileError, match="/histories/displacement cannot be read"):
        beamsim.load(damaged)
