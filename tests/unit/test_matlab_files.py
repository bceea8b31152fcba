"""MATLAB files: what SciPy reads is what was written, compressed in parts."""

import zlib

import numpy as np
from scipy.io import loadmat

from beamsim.store import matlab


def test_a_variable_is_compressed_in_parts_and_read_whole(monkeypatch, tmp_path):
    sizes, real = [], zlib.compressobj

    class Packer:
        def __init__(self):
            self.packer = real()

        def compress(self, data):
            sizes.append(len(data))
            return self.packer.compress(data)

        def flush(self):
            return self.packer.flush()

    monkeypatch.setattr(matlab.zlib, "compressobj", Packer)
    values = np.linspace(0.0, 1.0, 300_000)
    variables = {"probe": {"displacement": values, "units": "m"}, "title": "two words", "complex": values[:5] * 1j}
    matlab.write_mat(variables, tmp_path / "case.mat")
    assert sum(sizes) > values.nbytes
    assert max(sizes) == matlab.BYTES_AT_ONCE  # a signal is handled between two of them
    read = loadmat(tmp_path / "case.mat", squeeze_me=True)
    np.testing.assert_array_equal(read["probe"]["displacement"][()], values)
    np.testing.assert_array_equal(read["complex"], values[:5] * 1j)
    assert read["title"] == "two words"
    assert (tmp_path / "case.mat").stat().st_size < 0.9 * values.nbytes
    assert [path.name for path in tmp_path.iterdir()] == ["case.mat"]
