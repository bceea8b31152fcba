"""Result files: the HDF5 layout, writing, reading, export to other formats."""
