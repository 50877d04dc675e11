"""Scene files: a scene as plain data, written as TOML and read back to the same bits. Nothing of a file is executed.

Imports motions, elements and what lies below them; a scene is passed in, or made by a function that is passed in.

Begin with scene_text.py: a scene as text, and text as a scene. describe.py makes plain data of a scene, build.py a
scene of plain data. types.py knows the classes and their arguments, by their signatures, and values of all types;
toml_text.py finds lines and columns; schema.py makes the JSON Schema.
"""
