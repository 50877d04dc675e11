"""Files of long runs: the store that outputs stream to, and the checkpoint that a run goes on from.

Imports observables and below. Loaded by runs with a store alone.

Begin with archive.py, which a run writes to. hdf5.py and zarr_folder.py are the formats, by suffix in formats.py;
zarr_checks.py checks a folder before it is read; checkpoint.py writes and reads checkpoints; stored_outputs.py
reads outputs back, as a `Solution` asks for them. saved_file.py writes and reads a file of a whole solution.
"""
