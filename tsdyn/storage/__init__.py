"""Files of long runs: the store that outputs stream to, and the checkpoint that a run goes on from.

Imports observables and below. Loaded by runs with a store alone.

Begin with archive.py, which a run writes to, and by which a `Solution` reads outputs back. hdf5.py and zarr_folder.py
are the formats, by suffix in formats.py; checkpoint.py writes and reads checkpoints, saved_file.py files of whole
solutions.
"""
