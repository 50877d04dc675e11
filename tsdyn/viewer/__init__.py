"""The viewer: an interactive 3-D animation of a solution, as one HTML page that works offline.

`frames` resamples a run, `body_shapes`, `symbols` and `loads` say what is drawn, `run_data` encodes all of it, and the
files in `page/` draw it by three.js. Imports `observables` and what is below. Begin with `view`.
"""
