"""Result files that were damaged or edited: each is refused, and nothing that they name is opened."""

import gzip
import json
from hashlib import sha256
from pathlib import Path
from pkgutil import resolve_name

import h5py
import numpy as np
import pytest
from pydantic import TypeAdapter

import beamsim
from beamsim.cli.session import say, show
from beamsim.errors import ResultFileError, ScenarioError
from beamsim.files import seal
from beamsim.kinds import KINDS
from beamsim.report.page import script_json
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from tests.helpers.commands import invoke
from tests.helpers.crafted_results import outcomes

VALUES = (7.0, -1, "text", "", "null", '[1, {"a": null}]', np.nan, np.zeros(3), np.void(b"\xff\xfe"), h5py.Empty("f8"))


@pytest.fixture
def whole(fabricated_run, tmp_path):
    path = write_result(fabricated_run(rate=1e3), tmp_path / "whole.h5")
    assert load(path).complete
    return path


def edited(whole, edit, *, sealed=False):
    """A copy that a function changed; sealed as if it had been written so."""
    path = whole.with_name("edited.h5")
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        edit(file)
    if sealed:
        seal(path)
    return path


def places(whole):
    """Paths of all groups and datasets."""
    found = ["/"]
    with h5py.File(whole) as file:
        file.visit(found.append)
    return found


def test_a_result_as_it_was_written_is_read_by_this_process_alone(whole, monkeypatch):
    """Any other file is read by another process first, which the HDF5 library may end."""
    seal = whole.read_bytes()[-81:]
    assert seal == b"\nbeamsim sha256 " + sha256(whole.read_bytes()[:-81]).hexdigest().encode() + b"\n"
    with h5py.File(whole) as file:
        assert file.attrs["command"] == "run"

    def refuse(*_, **__):
        raise OSError(11, "examined")

    monkeypatch.setattr("subprocess.run", refuse)
    assert load(whole).complete
    raw = whole.read_bytes()
    for number, content in enumerate(
        (raw[:-1], raw[:-81], raw + b" ", raw[:5000] + bytes([raw[5000] ^ 1]) + raw[5001:])
    ):
        path = whole.with_name(f"{number}.h5")
        path.write_bytes(content)
        with pytest.raises(ResultFileError, match=rf"{number}\.h5.*examined"):
            load(path)


def test_edited_results_are_refused(whole, without_examination):
    """Attributes with values of other types or sizes, and groups and datasets taken away."""
    cases = []
    with h5py.File(whole) as file:
        for place in places(whole):
            names = [name for name in file[place].attrs if name.islower()]
            cases += [(place, name, value) for name in names for value in VALUES]
    tried = 0
    for place, name, value in cases[:: max(len(cases) // 20, 1)]:

        def edit(file, place=place, name=name, value=value):
            file[place].attrs[name] = value

        with pytest.raises(ResultFileError, match=r"edited\.h5"):
            load(edited(whole, edit))
        tried += 1
    owners = places(whole)[1:]
    for place in owners[:: max(len(owners) // 20, 1)]:
        with pytest.raises(ResultFileError, match=r"edited\.h5"):
            load(edited(whole, lambda file, place=place: file.__delitem__(place)))
        tried += 1
    assert tried >= 40


def test_declared_types_hold_with_a_right_seal(whole):
    for name, value in (("warnings", 3.5), ("warnings", "[1, 2]"), ("created", 7), ("wall_time_s", "soon")):

        def edit(file, name=name, value=value):
            file.attrs[name] = value

        with pytest.raises(ResultFileError, match="damaged"):
            load(edited(whole, edit, sealed=True))


def test_summary_entries_that_repeat_a_field_have_its_form(whole):
    for name, value in (("status", 3.5), ("kept_modes", "many"), ("open_frequencies_hz", 7.0), ("unheard_of", 1.0)):

        def edit(file, name=name, value=value):
            summary = file["summary"].attrs
            encoded = str(summary["json_encoded"]).split()
            summary["json_encoded"] = " ".join(each for each in encoded if each != name)
            summary[name] = value

        with pytest.raises(ResultFileError, match=rf"damaged \(summary: {name}( is|: )"):
            load(edited(whole, edit, sealed=True))


def test_other_summary_entries_have_the_declared_type(whole):
    for name, value, at in (
        ("events", "many", "events"),
        ("peak_force_n", '{"tip": "large"}', "peak_force_n.tip"),
        ("contacts", "[1]", "contacts"),
        ("spectral_lines", '[{"probe": "tip"}]', "spectral_lines.0"),
        ("margins", '{"gap": {"limit": 1.0, "value": 1.0, "margin": 0.0, "at": 3, "verdict": "ok"}}', "margins.gap.at"),
        ("doubtful", '[["a"]]', "doubtful.0"),
        ("linear", '"no"', "linear"),
    ):

        def edit(file, name=name, value=value):
            summary = file["summary"].attrs
            summary["json_encoded"] = " ".join(sorted({*str(summary["json_encoded"]).split(), name} - {"events"}))
            summary[name] = value

        with pytest.raises(ResultFileError, match=rf"damaged \(summary: {at}"):
            load(edited(whole, edit, sealed=True))


def test_every_summary_entry_has_a_type():
    for kind in KINDS.values():
        cls = resolve_name(kind.result)
        for entry in cls.SUMMARY:
            assert (entry.form is None) or not entry.variable
            TypeAdapter(entry.form)


@pytest.mark.parametrize("number", range(100, 116))
def test_crafted_results_are_shown_or_refused(number, tmp_path):
    """A crafted file of each kept result and every command; `python -m tests.helpers.crafted_results` tries more."""
    found = outcomes(number, tmp_path)
    assert set(found.values()) <= {"right", "refused"}, found


def test_contents_that_contradict_each_other_are_no_internal_error(whole):
    """Types and sizes are right, but the limited value is of a snubber that the case does not have."""

    def edit(file):
        summary = file["summary"].attrs
        summary["contacts"] = '{"another": 3}'

    done = invoke("info", edited(whole, edit, sealed=True))
    assert done.exit_code == 2
    assert "its contents contradict each other (tip is missing); run the case again" in done.output


def test_the_scenario_in_a_result_opens_no_file(whole, tmp_path):
    (tmp_path / "secret.yaml").write_text("title: secret\nbeam: {}\n")
    for text in (str(tmp_path / "secret.yaml"), f"extends: {tmp_path / 'secret.yaml'}\n", "/dev/zero"):

        def edit(file, text=text):
            file.attrs["scenario"] = text

        with pytest.raises(ResultFileError) as refused:
            load(edited(whole, edit, sealed=True))
        assert "secret" not in str(refused.value).replace(str(tmp_path / "secret.yaml"), "")


def test_datasets_that_are_not_as_written_are_refused(whole, tmp_path):
    def replaced(**options):
        def edit(file):
            del file["histories/time"]
            file.create_dataset("histories/time", **options)

        return edit

    def virtual(file):
        del file["histories/time"]
        layout = h5py.VirtualLayout((5,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (5,))
        file.create_virtual_dataset("histories/time", layout)

    (tmp_path / "raw").write_bytes(bytes(40))
    for edit in (
        virtual,
        replaced(shape=(5,), dtype="f8", external=[(str(tmp_path / "raw"), 0, 40)]),
        replaced(data=np.zeros(5), compression="gzip"),
        replaced(shape=(10**12,), dtype="f8", chunks=(10**6,)),
        replaced(data=h5py.Empty("f8")),
        replaced(data=np.zeros(5, dtype=[("a", "f8")])),
    ):
        with pytest.raises(ResultFileError, match=r"edited\.h5"):
            load(edited(whole, edit))


def test_an_older_layout_is_named(whole, without_examination):
    def edit(file):
        file.attrs["schema_version"] = 2
        del file["histories/time"]

    with pytest.raises(ResultFileError, match=r"schema_version 2, written by beamsim .* run its scenario again"):
        load(edited(whole, edit))


def test_control_characters_are_printed_as_escapes(capsys):
    text = "a\x1b[31m\rb\0\x7f\x9b\u202e\u2066 é\tline\n"
    say(text)
    show(text, json.dumps({"title": "\x9b"}, ensure_ascii=False))
    printed = capsys.readouterr()
    for stream in (printed.out, printed.err):
        assert "a\\u001b[31m\\u000db\\u0000\\u007f\\u009b\\u202e\\u2066 é\tline\n" in stream
        assert not set(stream) & set("\x1b\r\0\x7f\x9b\u202e\u2066")
    assert json.loads(printed.out.splitlines()[-1]) == {"title": "\x9b"}


def test_no_text_ends_the_json_block():
    texts = ["</script><script>alert(1)</script>", "<!--<script>", "]]>", "-->", "<SCRIPT"]
    block = script_json(texts)
    assert not set("<>") & set(block)
    assert json.loads(block) == texts


def test_an_orbit_of_a_damaged_file_is_refused(tmp_path, without_examination):
    stored = Path(__file__).parents[1] / "data" / "results" / "continuation.h5.gz"
    start = {"orbit": "stored.h5", "branch": 0, "point": 1}
    case = f"chain: {{masses: [1], springs: [400, 0]}}\nrun: {{duration: 1 s, start: {start}}}\n"
    case += "excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 5 Hz}\n"
    (tmp_path / "case.yaml").write_text(case)

    def edit(file):
        file["points/parameter"][0] = 7.0

    def remove(file):
        del file["points/parameter"]

    for change, sealed, message in ((edit, False, "was changed after"), (remove, True, "cannot be read as a result")):
        (tmp_path / "stored.h5").write_bytes(gzip.decompress(stored.read_bytes()))
        with h5py.File(tmp_path / "stored.h5", "a") as file:
            change(file)
        if sealed:
            seal(tmp_path / "stored.h5")
        with pytest.raises(ScenarioError, match=f"stored.h5 {message}.*; run the continuation again"):
            beamsim.run(load_scenario(tmp_path / "case.yaml"))
