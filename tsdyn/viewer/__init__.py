"""The viewer: an interactive 3-D animation of a solution or picture of a scene, as one HTML page that works offline.

`run_data` resamples and encodes a run, `symbols` says what is drawn, the files in `page/` draw it by three.js, and
`painting` by matplotlib, for GIFs. Imports `observables` and what is below. Begin with `view`.
"""
