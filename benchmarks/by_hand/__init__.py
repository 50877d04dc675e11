"""Timing anchors: kernels written by hand, each for one mechanism with its sizes and constants in the code.

Nothing of them serves another scene. They say what a mechanism costs where generality is not asked for, and being the
project's own code they can be timed in the same run as the general machinery: quote the ratio.
"""
