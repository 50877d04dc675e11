"""The viewer: an interactive 3-D animation of a solution, as one HTML page that works offline.

`run_data` resamples and encodes a run, `symbols` says what is drawn, and the files in `page/` draw it by three.js.
Imports `observables` and what is below. Begin with `view`.
"""
