"""Files: scenes as TOML, outputs and checkpoints of long runs, saved solutions. Nothing of a file is executed.

Imports forces, formulations and what lies below them; a scene is passed in, or made by a function that is passed in.

Scene files: begin with scene_text.py, a scene as text, and text as a scene to the same bits. build.py makes plain data
of a scene, and a scene of plain data. types.py knows the classes and their arguments, by their signatures, values of
all types, and the places of mistakes; schema.py makes the JSON Schema.

Files of runs: begin with archive.py, which a run writes to, and by which a `Solution` reads outputs back. hdf5.py and
zarr_folder.py are the formats, by suffix in formats.py; checkpoint.py writes and reads checkpoints, saved_file.py files
of whole solutions.
"""
